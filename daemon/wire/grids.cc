#include "daemon/wire/grids.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/scene/bounds.h"
#include "daemon/wire/check.h"
#include "daemon/wire/color_scale.h"
#include "daemon/wire/colors.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/shapes.h"
#include "gpu/curves/mix_colors.h"
#include "gpu/implicit/field_shape.h"
#include "gpu/primitives/samples.h"
#include "gpu/samples_bricks.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::SampleFilter;
using gpu::SampleFormat;
using gpu::SampleHead;
using gpu::implicit::Vector;

using Table = std::array<uint32_t, SampleHead::kTableEntries>;

// A validated grid.
struct ReadGrid {
  SampleHead head = {};
  uint64_t samples = 0;
  gpu::Affine map;  // maps samples' coordinates to the primitive's
  const std::string* bytes = nullptr;

  float Number(uint64_t i) const {
    switch (head.format) {
      case SampleFormat::kU8:
        return static_cast<float>(static_cast<uint8_t>((*bytes)[i]));
      case SampleFormat::kU16: {
        uint16_t number;
        std::memcpy(&number, bytes->data() + i * sizeof(number), sizeof(number));
        return static_cast<float>(number);
      }
      default: {
        float number;
        std::memcpy(&number, bytes->data() + i * sizeof(number), sizeof(number));
        return number;
      }
    }
  }
};

MaybeFault ToFormat(const FieldPath& path, const v1::Grid& in, bool colors, ReadGrid* out) {
  switch (in.type()) {
    case v1::ELEMENT_TYPE_UNSPECIFIED:
    case v1::ELEMENT_TYPE_F32:
      out->head.format = SampleFormat::kF32;
      break;
    case v1::ELEMENT_TYPE_U16:
      out->head.format = SampleFormat::kU16;
      break;
    case v1::ELEMENT_TYPE_U8:
      out->head.format = SampleFormat::kU8;
      break;
    case v1::ELEMENT_TYPE_RGBA8:
      out->head.format = SampleFormat::kRgba8;
      if (colors) break;
      [[fallthrough]];
    default:
      return UnknownEnum(
          FieldPath(path, "type"), in.type(),
          colors ? "ELEMENT_TYPE_F32, ELEMENT_TYPE_U16, ELEMENT_TYPE_U8, ELEMENT_TYPE_RGBA8"
                 : "ELEMENT_TYPE_F32, ELEMENT_TYPE_U16, ELEMENT_TYPE_U8");
  }
  switch (in.filter()) {
    case v1::Grid::FILTER_UNSPECIFIED:
    case v1::Grid::LINEAR:
      out->head.filter = SampleFilter::kLinear;
      return {};
    case v1::Grid::NEAREST:
      out->head.filter = SampleFilter::kNearest;
      return {};
    default:
      return UnknownEnum(FieldPath(path, "filter"), in.filter(), "LINEAR, NEAREST");
  }
}

MaybeFault ToPlace(const FieldPath& path, const v1::Grid& in, ReadGrid* out) {
  Vector corner, edges[3];
  if (auto fault = ToVector(FieldPath(path, "corner"), in.corner(), &corner)) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_a"), in.edge_a(), &edges[0])) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_b"), in.edge_b(), &edges[1])) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_c"), in.edge_c(), &edges[2])) return fault;
  double product = 1;
  for (const Vector& edge : edges) product *= gpu::implicit::Length(edge);
  const double volume = gpu::implicit::Dot(edges[0], gpu::implicit::Cross(edges[1], edges[2]));
  if (!(std::fabs(volume) > kLeastSine * product)) {
    return Fault{FieldPath(path, "edge_c").ToString(), Reason::kInvalidValue,
                 "spans no volume with edge_a and edge_b; give edges in three directions"};
  }
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) out->map.m[r * 4 + c] = edges[c][r] / out->head.size[c];
    out->map.m[r * 4 + 3] = corner[r];
  }
  if (!IsSingular(out->map)) return {};
  return Fault{FieldPath(path, "edge_c").ToString(), Reason::kSingularTransform,
               "spans next to nothing with edge_a and edge_b; give longer edges, and a transform"};
}

MaybeFault ToGrid(const FieldPath& path, const v1::Grid& in, bool colors, const Limits& limits,
                  ReadGrid* out) {
  if (auto fault = ToFormat(path, in, colors, out)) return fault;
  const std::pair<const char*, uint32_t> sizes[] = {
      {"size_a", in.size_a()}, {"size_b", in.size_b()}, {"size_c", in.size_c()}};
  out->samples = 1;
  for (int a = 0; a < 3; ++a) {
    const uint32_t size = sizes[a].second;
    if (size < 1 || size > SampleHead::kMostAlong) {
      return Fault{FieldPath(path, sizes[a].first).ToString(), Reason::kInvalidValue,
                   absl::StrCat("is ", size, "; give 1 to ", SampleHead::kMostAlong)};
    }
    out->head.size[a] = size;
    out->samples *= size;
  }
  if (SampleHead::WordsOf(out->head.format, out->samples) > limits.max_indices_per_entity) {
    return Fault{FieldPath(path, "size_a").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("makes ", out->samples, " samples; max_indices_per_entity allows ",
                              limits.max_indices_per_entity, " words of 4 bytes")};
  }
  const uint64_t each = out->head.format == SampleFormat::kU8    ? 1
                        : out->head.format == SampleFormat::kU16 ? 2
                                                                 : 4;
  const FieldPath samples(path, "samples");
  if (in.samples().size() != out->samples * each) {
    return Fault{samples.ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", ShowBytes(in.samples().size(), each, "sample"), "; ",
                              out->samples, " samples take ", out->samples * each)};
  }
  out->bytes = &in.samples();
  for (uint64_t i = 0; out->head.format == SampleFormat::kF32 && i < out->samples; ++i) {
    if (!std::isinf(out->Number(i))) continue;
    return Fault{FieldPath(path, "samples", static_cast<int64_t>(i)).ToString(),
                 Reason::kInvalidValue, "is infinite; give finite numbers, or none (NaN)"};
  }
  return ToPlace(path, in, out);
}

MaybeFault CheckTransfer(const FieldPath& path, const v1::Transfer& in) {
  const int count = in.values_size();
  if (count < 2 || count > 256) {
    return Fault{FieldPath(path, "values").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", count, "; give 2 to 256")};
  }
  for (int i = 0; i < count; ++i) {
    const FieldPath at(path, "values", i);
    if (auto fault = CheckFloat(at, in.values(i))) return fault;
    if (i > 0 && in.values(i) < in.values(i - 1)) {
      return Fault{at.ToString(), Reason::kInvalidValue,
                   absl::StrCat("is ", Show(in.values(i)), " after ", Show(in.values(i - 1)),
                                "; give values that do not descend")};
    }
  }
  if (!(in.values(0) < in.values(count - 1))) {
    return Fault{FieldPath(path, "values", count - 1).ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.values(0)), " as the first; give a greater one")};
  }
  if (!in.colors().empty() && in.colors_size() != count) {
    return Fault{
        FieldPath(path, "colors").ToString(), Reason::kSizeMismatch,
        absl::StrCat("has ", in.colors_size(), " for ", count, " values; give one for each")};
  }
  if (!in.opacities().empty() && in.opacities_size() != count) {
    return Fault{FieldPath(path, "opacities").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", in.opacities_size(), " for ", count,
                              " values; give one for each, or none")};
  }
  for (int i = 0; i < in.opacities_size(); ++i) {
    if (in.opacities(i) >= 0 && in.opacities(i) <= 1) continue;
    return Fault{FieldPath(path, "opacities", i).ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.opacities(i)), "; give 0 to 1")};
  }
  return {};
}

MaybeFault ToTable(const FieldPath& path, const v1::Transfer& in, SampleHead* head, Table* out) {
  if (auto fault = CheckTransfer(path, in)) return fault;
  std::optional<ColorTable> map;
  if (auto fault = ToColorRow(path, in.colormap(), in.colors(), &map)) return fault;
  const double low = in.values(0), high = in.values(in.values_size() - 1);
  head->low = static_cast<float>(low);
  head->scale = static_cast<float>(SampleHead::kTableEntries / (high - low));
  if (!std::isfinite(head->scale)) {
    return Fault{FieldPath(path, "values", in.values_size() - 1).ToString(), Reason::kOutOfRange,
                 absl::StrCat("is ", Show(high), " after ", Show(low),
                              ", too little apart for single precision; scale the samples")};
  }
  int stop = 0;
  for (size_t i = 0; i < out->size(); ++i) {
    // The first and last entries are exactly the ends, which also apply beyond them.
    const double value =
        low + static_cast<double>(i) / (SampleHead::kTableEntries - 1) * (high - low);
    while (stop + 2 < in.values_size() && in.values(stop + 1) <= value) ++stop;
    const double from = in.values(stop), to = in.values(stop + 1);
    const double t = to > from ? std::clamp((value - from) / (to - from), 0.0, 1.0) : 1;
    const uint32_t rgb = map.has_value()
                             ? (*map)[i]
                             : gpu::curves::MixColors(in.colors(stop), in.colors(stop + 1), t);
    const double opacity =
        in.opacities().empty()
            ? 1
            : in.opacities(stop) + (in.opacities(stop + 1) - in.opacities(stop)) * t;
    (*out)[i] = opacity > 0 ? gpu::curves::MixColors(0, rgb, opacity) | SampleHead::kDrawn : 0;
  }
  return {};
}

// Finds the least and greatest number, if there are any.
void FindRange(const ReadGrid& grid, float* least, float* greatest) {
  bool any = false;
  for (uint64_t i = 0; i < grid.samples; ++i) {
    const float number = grid.Number(i);
    if (std::isnan(number)) continue;
    *least = any ? std::min(*least, number) : number;
    *greatest = any ? std::max(*greatest, number) : number;
    any = true;
  }
}

// Draws the samples above the middle of the range in one colour.
void SetHalf(const ReadGrid& grid, uint32_t color, SampleHead* head, Table* out) {
  float least = 0, greatest = 0;
  FindRange(grid, &least, &greatest);
  head->low = least;
  head->scale = static_cast<float>(SampleHead::kTableEntries / (double{greatest} - double{least}));
  // If all numbers are practically equal, none is above the middle.
  if (!std::isfinite(head->scale)) head->scale = 0;
  for (size_t i = 0; i < out->size(); ++i) {
    (*out)[i] = i < out->size() / 2 ? 0 : color | SampleHead::kDrawn;
  }
}

// Returns: the bounds in the primitive's coordinates.
Bounds BoundsOf(const ReadGrid& grid) {
  Bounds box;
  box.empty = false;
  for (int a = 0; a < 3; ++a) box.max[a] = grid.head.size[a];
  return MapBounds(grid.map, box);
}

// For a surface: maps a position in the samples to an entry of the table.
MaybeFault ToColorsByPlace(const FieldPath& path, const v1::ColorScale& in, ReadGrid* grid,
                           gpu::GeometryRecord* look, Table* out) {
  if (auto fault = ToScaleTable(path, in, out)) return fault;
  for (uint32_t& entry : *out) entry |= SampleHead::kDrawn;
  const Bounds bounds = BoundsOf(*grid);
  ScaleEnds ends;
  if (auto fault = ToScaleEnds(path, in, bounds.min, bounds.max, &ends)) return fault;
  const double each = SampleHead::kTableEntries / (ends.high - ends.low);
  for (int c = 0; c < 4; ++c) {
    double along = c == 3 ? -ends.low : 0;
    for (int r = 0; r < 3; ++r) along += ends.along[r] * grid->map.m[r * 4 + c];
    look->params[c] = static_cast<float>(along * each);
    if (std::isfinite(look->params[c])) continue;
    return Fault{FieldPath(path, "high").ToString(), Reason::kOutOfRange,
                 absl::StrCat("is ", Show(in.high()), " and low ", Show(in.low()),
                              ", too near to one another for single precision; give others")};
  }
  grid->head.by_level = 2;
  return {};
}

MaybeFault Finish(const FieldPath& path, const ReadGrid& grid, const Table& table,
                  const gpu::GeometryRecord& look, const DecodeContext& context, GroupData* out) {
  auto data = std::make_shared<GeometryData>();
  gpu::GeometryRecord& record = data->record;
  record = look;
  record.kind = gpu::PrimitiveKind::kSamples;
  SampleHead head = grid.head;
  head.bricks = gpu::BrickWords(head.size);
  const uint64_t words = gpu::SampleWords(head.size, static_cast<uint32_t>(head.format));
  record.index_count = static_cast<uint32_t>(words);
  absl::StatusOr<gpu::GeometryArrays> kept = gpu::GeometryArrays::Allocate(record, context.pool);
  if (!kept.ok()) {
    return Fault{path.ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("cannot be kept: ", kept.status().message())};
  }
  data->arrays = *std::move(kept);
  const std::span<uint32_t> all = data->arrays.writable_indices();
  std::memcpy(all.data(), &head, sizeof(head));
  std::copy(table.begin(), table.end(), all.begin() + gpu::kSampleHeadWords);
  const std::span<uint32_t> samples =
      all.subspan(gpu::kSampleHeadWords + SampleHead::kTableEntries + head.bricks);
  samples.back() = 0;  // after the last sample
  std::memcpy(samples.data(), grid.bytes->data(), grid.bytes->size());
  if (head.format == SampleFormat::kRgba8) {
    for (uint32_t& word : samples) {  // 0xAARRGGBB
      word = (word & 0xFF00FF00u) | (word & 0xFFu) << 16 | (word >> 16 & 0xFFu);
    }
  }
  gpu::FillBricks(record, all);
  for (int a = 0; a < 3; ++a) data->max[a] = grid.head.size[a];
  const Bounds mapped = BoundsOf(grid);
  std::copy_n(mapped.min, 3, out->min);
  std::copy_n(mapped.max, 3, out->max);
  out->color = look.color;
  out->parts.push_back({std::move(data), grid.map});
  return {};
}

}  // namespace

MaybeFault ToVolume(const FieldPath& path, const v1::Volume& in, uint32_t color,
                    const DecodeContext& context, GroupData* out) {
  ReadGrid grid;
  if (auto fault = ToGrid(FieldPath(path, "grid"), in.grid(), true, context, &grid)) return fault;
  Table table = {};
  const FieldPath transfer(path, "transfer");
  if (grid.head.format == SampleFormat::kRgba8) {
    if (in.has_transfer()) {
      return Fault{transfer.ToString(), Reason::kInvalidValue,
                   "is given, but the samples are colours; leave it unset, or give numbers"};
    }
  } else if (in.has_transfer()) {
    if (auto fault = ToTable(transfer, in.transfer(), &grid.head, &table)) return fault;
  } else {
    SetHalf(grid, color, &grid.head, &table);
  }
  gpu::GeometryRecord look;
  look.color = color;
  return Finish(path, grid, table, look, context, out);
}

MaybeFault ToIsosurface(const FieldPath& path, const v1::Isosurface& in, uint32_t color,
                        const ShapeContext& shape, GroupData* out) {
  const DecodeContext& context = shape.context;
  ReadGrid grid;
  gpu::GeometryRecord look;
  look.color = color;
  if (auto fault = ToGrid(FieldPath(path, "grid"), in.grid(), false, context, &grid)) return fault;
  if (auto fault = CheckFloat(FieldPath(path, "level"), in.level())) return fault;
  if (auto fault = ToFill(path, in.fill(), &look)) return fault;
  if (auto fault = ToRule(path, in.rule(), &look)) return fault;
  const bool surface = look.fill == gpu::Fill::kSurface;
  if (auto fault = ToShell(path, in.shell(), surface, context, &look)) return fault;
  grid.head.by_level = 1;
  grid.head.level = static_cast<float>(in.level());
  // Converts the thickness from the primitive's units to samples, by the mean edge of a cell.
  if (look.thickness_unit == gpu::ThicknessUnit::kUnits) {
    const double thickness =
        static_cast<double>(look.thickness) / std::cbrt(std::fabs(gpu::Determinant(grid.map)));
    if (CheckFloat(path, thickness).has_value()) {
      return Fault{
          FieldPath(path, "shell").ToString(), Reason::kOutOfRange,
          absl::StrCat("is ", Show(thickness), " samples thick; give less, or another grid")};
    }
    look.thickness = static_cast<float>(thickness);
  }
  Table table = {};
  if (shape.scale != nullptr) {
    if (auto fault = ToColorsByPlace(shape.scale_path, *shape.scale, &grid, &look, &table)) {
      return fault;
    }
  }
  return Finish(path, grid, table, look, context, out);
}

}  // namespace voxeld::daemon::wire
