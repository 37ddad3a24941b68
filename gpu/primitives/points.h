// Points: the voxel ⌊P⌋ each; with a thickness also the ball around P, one that fades, or a cube.
#pragma once

#include "gpu/primitives/capsule.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

struct Points {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kPoints;

  // Of a colour, 255 at the middle and 0 at the radius: falls with the square of the distance.
  // `square` ≤ `whole`, the radius' own.
  VOXELD_HD static uint32_t Faded(uint32_t rgb, double square, double whole) {
    const uint32_t left = static_cast<uint32_t>(FloorToInt((whole - square) * 255.0 / whole));
    return Tinted(rgb, left << 16 | left << 8 | left);
  }

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
    if (source.radius == 0) return;
    const Splat splat = source.record->splat;
    if (splat == Splat::kBall) return EmitCapsule(Capsule::Of(point, source.radius), box, emit);
    EmitSplat(point, source.radius, splat, box, emit);
  }

 private:
  // Voxels whose centres are no farther than the radius: in any direction, or along each axis.
  template <class Emit>
  VOXELD_HD static void EmitSplat(const Line& point, int64_t radius, Splat splat, const Box3& box,
                                  Emit&& emit) {
    const Box3 near = Intersect(BoundsOf(point, radius), box);
    const double whole = static_cast<double>(radius) * static_cast<double>(radius);
    for (int32_t z = near.lo[2]; z < near.hi[2]; ++z) {
      const int64_t dz = z * kUnitsPerVoxel + kHalfVoxel - point.s[2];
      for (int32_t y = near.lo[1]; y < near.hi[1]; ++y) {
        const int64_t dy = y * kUnitsPerVoxel + kHalfVoxel - point.s[1];
        for (int32_t x = near.lo[0]; x < near.hi[0]; ++x) {
          const int64_t dx = x * kUnitsPerVoxel + kHalfVoxel - point.s[0];
          if (splat == Splat::kCube) {
            if (Max(Max(Abs(dx), Abs(dy)), Abs(dz)) <= radius) emit(x, y, z, point.color_s);
            continue;
          }
          const double w[3] = {static_cast<double>(dx), static_cast<double>(dy),
                               static_cast<double>(dz)};
          const double square = (w[0] * w[0] + w[1] * w[1]) + w[2] * w[2];
          if (square > whole) continue;
          const uint32_t rgb = Faded(point.color_s, square, whole);
          // What has faded to black is left to what lies below.
          if (rgb != 0) emit(x, y, z, rgb);
        }
      }
    }
  }
};

}  // namespace voxeld::gpu
