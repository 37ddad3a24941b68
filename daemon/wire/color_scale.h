// Colours by numbers (voxeld.v1.ColorScale).
#pragma once

#include <array>
#include <cstdint>

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"
#include "gpu/implicit/field_shape.h"
#include "gpu/implicit/graph.h"

namespace voxeld::v1 {
class ColorScale;
class Primitive;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

using ScaleTable = std::array<uint32_t, 256>;  // 0x00RRGGBB

// The colours of a scale, from the low end to the high one.
MaybeFault ToScaleTable(const FieldPath& path, const v1::ColorScale& in, ScaleTable* out);

// Gives the vertices of `out`, which have none, the colours that `path`, a scale of the primitive's, says.
MaybeFault ToVertexColors(const FieldPath& path, const v1::ColorScale& in,
                          const DecodeContext& context, GeometryData* out);

// What numbers a scale has along a direction: p · along, from low to high.
struct ScaleEnds {
  gpu::implicit::Vector along;  // divided by the square of its length
  double low = 0, high = 1;
};
// Of a shape without vertices in `min` to `max`.
MaybeFault ToScaleEnds(const FieldPath& path, const v1::ColorScale& in, const double min[3],
                       const double max[3], ScaleEnds* out);

// The level of a place, 0 to 1 from one end to the other, as a node, and the table of it. `min` and `max` are what
// the shape lies in.
MaybeFault ToLevel(const FieldPath& path, const v1::ColorScale& in, const double min[3],
                   const double max[3], gpu::implicit::Graph& graph,
                   gpu::implicit::Graph::Node* level, ScaleTable* table);

}  // namespace voxeld::daemon::wire
