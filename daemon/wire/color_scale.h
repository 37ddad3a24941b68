// Maps numbers to colours (voxeld.v1.ColorScale).
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

// Reads the colours of a scale, from the low end to the high end.
MaybeFault ToScaleTable(const FieldPath& path, const v1::ColorScale& in, ScaleTable* out);

// Assigns the colours of the scale at `path` to the vertices of `out`. Requires: the vertices have
// no colours.
MaybeFault ToVertexColors(const FieldPath& path, const v1::ColorScale& in,
                          const DecodeContext& context, GeometryData* out);

// The numbers of a scale along a direction: p · along, from low to high.
struct ScaleEnds {
  gpu::implicit::Vector along;  // divided by the squared length
  double low = 0, high = 1;
};
// Reads the ends of a scale for a shape without vertices, which lies within `min` and `max`.
MaybeFault ToScaleEnds(const FieldPath& path, const v1::ColorScale& in, const double min[3],
                       const double max[3], ScaleEnds* out);

// Creates a node for the level of a place, from 0 at one end to 1 at the other, and the table of
// colours. The shape lies within `min` and `max`.
MaybeFault ToLevel(const FieldPath& path, const v1::ColorScale& in, const double min[3],
                   const double max[3], gpu::implicit::Graph& graph,
                   gpu::implicit::Graph::Node* level, ScaleTable* table);

}  // namespace voxeld::daemon::wire
