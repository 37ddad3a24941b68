#include "daemon/wire/color_scale.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/colors.h"
#include "daemon/wire/fields.h"
#include "gpu/curves/mix_colors.h"
#include "gpu/implicit/field_shape.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Vector;

MaybeFault ToEnds(const FieldPath& path, const v1::ColorScale& in) {
  if (auto fault = CheckFloat(FieldPath(path, "low"), in.low())) return fault;
  if (auto fault = CheckFloat(FieldPath(path, "high"), in.high())) return fault;
  if (in.low() == in.high() && in.low() != 0) {
    return Fault{FieldPath(path, "high").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.high()), " as low is; give another number")};
  }
  return {};
}

// Computes the vector for (p · along) / |along|².
MaybeFault ToAlong(const FieldPath& path, const v1::ColorScale& in, Vector* out) {
  const FieldPath at(path, "along");
  Vector along;
  if (auto fault = ToVector(at, in.along(), &along)) return fault;
  const double square = gpu::implicit::Dot(along, along);
  if (!(square > 0)) {  // the square of three floats is finite as a double
    return Fault{at.ToString(), Reason::kInvalidValue, "has no direction; give one that is not 0"};
  }
  *out = 1 / square * along;
  return {};
}

}  // namespace

MaybeFault ToScaleTable(const FieldPath& path, const v1::ColorScale& in, ScaleTable* out) {
  std::optional<ColorTable> map;
  if (auto fault = ToColorRow(path, in.colormap(), in.colors(), &map)) return fault;
  if (map.has_value()) {
    *out = *map;
    return {};
  }
  if (in.colors_size() < 2 || in.colors_size() > 256) {
    return Fault{FieldPath(path, "colors").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", in.colors_size(), "; give 2 to 256")};
  }
  for (size_t i = 0; i < out->size(); ++i) {
    const double place = static_cast<double>(i) / 255 * (in.colors_size() - 1);
    const int first = std::min(static_cast<int>(place), in.colors_size() - 2);
    (*out)[i] = gpu::curves::MixColors(in.colors(first), in.colors(first + 1), place - first);
  }
  return {};
}

MaybeFault ToVertexColors(const FieldPath& path, const v1::ColorScale& in,
                          const DecodeContext& context, GeometryData* out) {
  ScaleTable table;
  if (auto fault = ToScaleTable(path, in, &table)) return fault;
  if (auto fault = ToEnds(path, in)) return fault;
  if (out->record.color_mode == gpu::ColorMode::kPerVertex) {
    return Fault{path.ToString(), Reason::kInvalidValue,
                 "is given, and so are colours of vertices; give one of the two"};
  }
  const size_t count = out->record.vertex_count;
  std::vector<double> numbers(count);
  if (in.has_along() == !in.scalars().empty()) {
    return Fault{FieldPath(path, "along").ToString(), Reason::kInvalidValue,
                 in.has_along() ? "is given, and so is scalars; give one of the two"
                                : "is missing, and so is scalars; give one of the two"};
  }
  if (in.has_along()) {
    Vector along;
    if (auto fault = ToAlong(path, in, &along)) return fault;
    const std::span<const float> p = out->arrays.positions();
    for (size_t i = 0; i < count; ++i) {
      numbers[i] = gpu::implicit::Dot(
          along, {static_cast<double>(p[i * 3]), static_cast<double>(p[i * 3 + 1]),
                  static_cast<double>(p[i * 3 + 2])});
    }
  } else {
    if (in.scalars().size() != count * sizeof(float)) {
      return Fault{FieldPath(path, "scalars").ToString(), Reason::kSizeMismatch,
                   absl::StrCat("has ", ShowBytes(in.scalars().size(), sizeof(float), "number"),
                                "; ", count, " vertices take ", count * sizeof(float))};
    }
    for (size_t i = 0; i < count; ++i) {
      float number;
      std::memcpy(&number, in.scalars().data() + i * sizeof(number), sizeof(number));
      numbers[i] = static_cast<double>(number);
      if (auto fault =
              CheckFinite(FieldPath(path, "scalars", static_cast<int64_t>(i)), numbers[i])) {
        return fault;
      }
    }
  }
  double low = in.low(), high = in.high();
  if (low == high) {
    const auto [least, greatest] = std::minmax_element(numbers.begin(), numbers.end());
    low = *least;
    high = *greatest;
  }
  gpu::GeometryRecord record = out->record;
  record.color_mode = gpu::ColorMode::kPerVertex;
  absl::StatusOr<gpu::GeometryArrays> colored = gpu::GeometryArrays::Allocate(record, context.pool);
  if (!colored.ok()) {
    return Fault{path.ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("colours cannot be kept: ", colored.status().message())};
  }
  std::copy(out->arrays.positions().begin(), out->arrays.positions().end(),
            colored->writable_positions().begin());
  std::copy(out->arrays.indices().begin(), out->arrays.indices().end(),
            colored->writable_indices().begin());
  for (size_t i = 0; i < count; ++i) {
    const double level = (numbers[i] - low) / (high - low);
    // If the range is empty or above all numbers, every vertex gets the first colour.
    colored->writable_colors()[i] =
        table[level > 0 ? static_cast<size_t>(std::lround(std::min(level, 1.0) * 255)) : 0];
  }
  out->record = record;
  out->arrays = *std::move(colored);
  return {};
}

MaybeFault ToScaleEnds(const FieldPath& path, const v1::ColorScale& in, const double min[3],
                       const double max[3], ScaleEnds* out) {
  if (auto fault = ToEnds(path, in)) return fault;
  if (!in.scalars().empty()) {
    return Fault{FieldPath(path, "scalars").ToString(), Reason::kInvalidValue,
                 "is given, but the shape has no vertices; give along"};
  }
  if (auto fault = ToAlong(path, in, &out->along)) return fault;
  out->low = in.low();
  out->high = in.high();
  if (out->low != out->high) return {};
  out->low = out->high = 0;
  for (int a = 0; a < 3; ++a) {
    out->low += std::min(out->along[a] * min[a], out->along[a] * max[a]);
    out->high += std::max(out->along[a] * min[a], out->along[a] * max[a]);
  }
  if (out->low == out->high) out->high = out->low + 1;
  return {};
}

MaybeFault ToLevel(const FieldPath& path, const v1::ColorScale& in, const double min[3],
                   const double max[3], gpu::implicit::Graph& graph,
                   gpu::implicit::Graph::Node* level, ScaleTable* table) {
  ScaleEnds ends;
  if (auto fault = ToScaleTable(path, in, table)) return fault;
  if (auto fault = ToScaleEnds(path, in, min, max, &ends)) return fault;
  *level = graph.Mul(gpu::implicit::Along(graph, ends.along, ends.low),
                     graph.Constant(1 / (ends.high - ends.low)));
  return {};
}

}  // namespace voxeld::daemon::wire
