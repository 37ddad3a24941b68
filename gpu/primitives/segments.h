// Segments, as a list, a strip or a loop: one voxel wide by their sampling rule; with a thickness,
// the capsule around each and the line's own voxels.
#pragma once

#include "gpu/primitives/capsule.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Segments {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kSegments;

  // A strip or loop of fewer than two corners has no segments.
  VOXELD_HD static uint32_t Count(const Source& source) {
    const uint32_t corners = source.corners();
    if (source.record->topology == Topology::kList) return corners / 2;
    if (corners < 2) return 0;
    return source.record->topology == Topology::kLoop ? corners : corners - 1;
  }

  VOXELD_HD static Line ItemOf(const Source& source, uint32_t i) {
    const bool list = source.record->topology == Topology::kList;
    const uint32_t first = list ? i * 2 : i;
    const uint32_t second = first + 1 == source.corners() ? 0 : first + 1;
    const uint32_t a = source.VertexOf(first), b = source.VertexOf(second);
    return {source.Vertex(a), source.Vertex(b), source.ColorOf(a), source.ColorOf(b),
            source.record->sampling};
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    EmitTilesOfLine(ItemOf(source, i), source.radius, grid, emit);
  }

  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t i, const Box3& box, Emit&& emit) {
    const Line line = ItemOf(source, i);
    EmitLine(line, box, emit);
    if (source.radius > 0) EmitCapsule(Capsule::Of(line, source.radius), box, emit);
  }
};

}  // namespace voxeld::gpu
