// Points: the voxel ⌊P⌋ each; with a thickness the ball around P, and that voxel.
#pragma once

#include "gpu/primitives/capsule.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Points {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kPoints;

  VOXELD_HD static uint32_t Count(const Source& source) { return source.corners(); }

  VOXELD_HD static Line ItemOf(const Source& source, uint32_t i) {
    const uint32_t vertex = source.VertexOf(i);
    const uint32_t rgb = source.ColorOf(vertex);
    const Int3 at = source.Vertex(vertex);
    return {at, at, rgb, rgb};
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const Line point = ItemOf(source, i);
    if (source.radius > 0) return EmitTilesOfLine(point, source.radius, grid, emit);
    const Box3 volume{{0, 0, 0}, {grid.voxels[0], grid.voxels[1], grid.voxels[2]}};
    EmitVoxelOf(point.s, 0, volume,
                [&](int32_t x, int32_t y, int32_t z, uint32_t) { emit(grid.TileOf(x, y, z)); });
  }

  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t i, const Box3& box, Emit&& emit) {
    const Line point = ItemOf(source, i);
    EmitVoxelOf(point.s, point.color_s, box, emit);
    if (source.radius > 0) EmitCapsule(Capsule::Of(point, source.radius), box, emit);
  }
};

}  // namespace voxeld::gpu
