#include "daemon/wire/height_map.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/check.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/texture.h"
#include "gpu/implicit/field_shape.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Vector;

constexpr uint32_t kCornersPerCell = 6;

// Checks the counts of the grid and the sizes of its payloads.
MaybeFault CheckGrid(const FieldPath& path, const v1::HeightMap& in, const Limits& limits) {
  const std::pair<const char*, uint32_t> sides[] = {{"columns", in.columns()}, {"rows", in.rows()}};
  for (const auto& [name, count] : sides) {
    if (count >= 2) continue;
    return Fault{FieldPath(path, name).ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", count, "; give 2 or more")};
  }
  const uint64_t samples = uint64_t{in.columns()} * in.rows();
  const uint64_t corners = uint64_t{in.columns() - 1} * (in.rows() - 1) * kCornersPerCell;
  if (samples > limits.max_vertices_per_entity || corners > limits.max_indices_per_entity) {
    return Fault{FieldPath(path, "rows").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("makes ", samples, " samples and ", corners,
                              " corners of triangles; max_vertices_per_entity is ",
                              limits.max_vertices_per_entity, ", max_indices_per_entity ",
                              limits.max_indices_per_entity)};
  }
  uint64_t bytes = sizeof(float);
  switch (in.height_type()) {
    case v1::ELEMENT_TYPE_UNSPECIFIED:
    case v1::ELEMENT_TYPE_F32:
      break;
    case v1::ELEMENT_TYPE_U16:
      bytes = sizeof(uint16_t);
      break;
    default:
      return UnknownEnum(FieldPath(path, "height_type"), in.height_type(),
                         "ELEMENT_TYPE_F32, ELEMENT_TYPE_U16");
  }
  if (in.heights().size() != samples * bytes) {
    return Fault{FieldPath(path, "heights").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", ShowBytes(in.heights().size(), bytes, "height"), "; ",
                              samples, " samples take ", samples * bytes)};
  }
  if (!in.colors().empty() && in.colors().size() != samples * 3) {
    return Fault{FieldPath(path, "colors").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", ShowBytes(in.colors().size(), 3, "colour"), "; ", samples,
                              " samples take ", samples * 3)};
  }
  return {};
}

double HeightAt(const v1::HeightMap& in, size_t sample) {
  if (in.height_type() == v1::ELEMENT_TYPE_U16) {
    uint16_t height;
    std::memcpy(&height, in.heights().data() + sample * sizeof(height), sizeof(height));
    return height / 65535.0;
  }
  float height;
  std::memcpy(&height, in.heights().data() + sample * sizeof(height), sizeof(height));
  return static_cast<double>(height);
}

// Creates two triangles per square, divided from its first sample to the opposite one.
void FillTriangles(uint32_t columns, uint32_t rows, std::span<uint32_t> out) {
  size_t at = 0;
  for (uint32_t row = 0; row + 1 < rows; ++row) {
    for (uint32_t column = 0; column + 1 < columns; ++column) {
      const uint32_t first = row * columns + column, below = first + columns;
      for (const uint32_t index : {first, first + 1, below + 1, first, below + 1, below}) {
        out[at++] = index;
      }
    }
  }
}

// Creates lines between neighbours along rows and columns.
void FillLines(uint32_t columns, uint32_t rows, std::span<uint32_t> out) {
  size_t at = 0;
  for (uint32_t row = 0; row < rows; ++row) {
    for (uint32_t column = 0; column < columns; ++column) {
      const uint32_t sample = row * columns + column;
      const uint32_t right = column + 1 < columns ? 1 : 0, below = row + 1 < rows ? columns : 0;
      for (const uint32_t step : {right, below}) {
        if (step == 0) continue;
        out[at++] = sample;
        out[at++] = sample + step;
      }
    }
  }
}

MaybeFault ToFill(const FieldPath& path, const v1::HeightMap& in, gpu::GeometryRecord* out) {
  const uint32_t columns = in.columns(), rows = in.rows();
  out->vertex_count = columns * rows;
  switch (in.fill()) {
    case v1::FILL_UNSPECIFIED:
    case v1::FILL_SURFACE:
      out->kind = gpu::PrimitiveKind::kTriangles;
      out->index_count = (columns - 1) * (rows - 1) * kCornersPerCell;
      return {};
    case v1::FILL_LINES:
      out->kind = gpu::PrimitiveKind::kSegments;
      out->topology = gpu::Topology::kList;
      out->index_count = ((columns - 1) * rows + columns * (rows - 1)) * 2;
      break;
    case v1::FILL_DOTS:
      out->kind = gpu::PrimitiveKind::kPoints;
      break;
    case v1::FILL_SOLID:
      return Fault{
          FieldPath(path, "fill").ToString(), Reason::kInvalidValue,
          "is FILL_SOLID, but it has no inside; give FILL_SURFACE, FILL_LINES or FILL_DOTS"};
    default:
      return UnknownEnum(FieldPath(path, "fill"), in.fill(), "FILL_SURFACE, FILL_LINES, FILL_DOTS");
  }
  if (in.picture().empty()) return {};
  return Fault{FieldPath(path, "picture").ToString(), Reason::kInvalidValue,
               "is given, but only a surface takes one; leave it out, or fill"};
}

void FillIndices(const gpu::GeometryRecord& record, const v1::HeightMap& in,
                 std::span<uint32_t> out) {
  if (record.kind == gpu::PrimitiveKind::kTriangles) FillTriangles(in.columns(), in.rows(), out);
  if (record.kind == gpu::PrimitiveKind::kSegments) FillLines(in.columns(), in.rows(), out);
}

}  // namespace

MaybeFault ToHeightMap(const FieldPath& path, const v1::HeightMap& in, const DecodeContext& context,
                       GeometryData* out) {
  gpu::GeometryRecord& record = out->record;
  Vector corner, edges[2], up = {0, 0, 1};
  if (auto fault = ToVector(FieldPath(path, "corner"), in.corner(), &corner)) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_a"), in.edge_a(), &edges[0])) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_b"), in.edge_b(), &edges[1])) return fault;
  if (in.has_up()) {
    if (auto fault = ToVector(FieldPath(path, "up"), in.up(), &up)) return fault;
  }
  const double product = gpu::implicit::Length(edges[0]) * gpu::implicit::Length(edges[1]);
  if (!(gpu::implicit::Length(gpu::implicit::Cross(edges[0], edges[1])) > kLeastSine * product)) {
    return Fault{FieldPath(path, "edge_b").ToString(), Reason::kInvalidValue,
                 "lies along edge_a; the two edges must span an area"};
  }
  if (auto fault = CheckGrid(path, in, context)) return fault;
  if (auto fault = ToRule(path, in.rule(), &record)) return fault;

  if (auto fault = ToFill(path, in, &record)) return fault;
  const bool surface = record.kind == gpu::PrimitiveKind::kTriangles;
  if (auto fault = ToShell(path, in.shell(), surface, context, &record)) return fault;
  if (!in.colors().empty()) record.color_mode = gpu::ColorMode::kPerVertex;
  absl::StatusOr<gpu::GeometryArrays> kept = gpu::GeometryArrays::Allocate(record, context.pool);
  if (!kept.ok()) {
    return Fault{FieldPath(path, "heights").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("cannot be kept: ", kept.status().message())};
  }
  out->arrays = *std::move(kept);
  const std::span<float> positions = out->arrays.writable_positions();
  for (uint32_t row = 0; row < in.rows(); ++row) {
    const Vector begin = corner + (row / (in.rows() - 1.0)) * edges[1];
    for (uint32_t column = 0; column < in.columns(); ++column) {
      const size_t sample = size_t{row} * in.columns() + column;
      const double height = HeightAt(in, sample);
      const Vector at = begin + (column / (in.columns() - 1.0)) * edges[0] + height * up;
      for (int a = 0; a < 3; ++a) {
        const float position = static_cast<float>(at[a]);
        if (!std::isfinite(position)) {
          return Fault{FieldPath(path, "heights", static_cast<int64_t>(sample)).ToString(),
                       Reason::kInvalidValue,
                       absl::StrCat("is ", Show(height), "; give numbers that stay finite")};
        }
        positions[sample * 3 + static_cast<size_t>(a)] = position;
        const double value = double{position};
        out->min[a] = sample == 0 ? value : std::min(out->min[a], value);
        out->max[a] = sample == 0 ? value : std::max(out->max[a], value);
      }
    }
  }
  FillIndices(record, in, out->arrays.writable_indices());
  const auto* color = reinterpret_cast<const uint8_t*>(in.colors().data());
  for (uint32_t& rgb : out->arrays.writable_colors()) {
    rgb = uint32_t{color[0]} << 16 | uint32_t{color[1]} << 8 | color[2];
    color += 3;
  }
  return {};
}

// The picture extends from edge to edge, regardless of the heights.
MaybeFault AddHeightMapPicture(const FieldPath& path, const v1::HeightMap& in,
                               const DecodeContext& context, GeometryData* out) {
  if (in.picture().empty()) return {};
  std::vector<float> places;
  places.reserve(size_t{2} * out->record.vertex_count);
  for (uint32_t row = 0; row < in.rows(); ++row) {
    for (uint32_t column = 0; column < in.columns(); ++column) {
      places.push_back(static_cast<float>(column / (in.columns() - 1.0)));
      places.push_back(static_cast<float>(row / (in.rows() - 1.0)));
    }
  }
  return AddPicture(FieldPath(path, "picture"), in.picture(), places, context, out);
}

}  // namespace voxeld::daemon::wire
