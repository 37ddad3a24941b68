// A triangle of at most 64 voxels' extent in 32 bits, for the tiles that it is in: exactly the voxels of THIN
// (primitives/triangle.h).
//
// Relative to the voxel of its first vertex, in units of 2⁻⁸ voxel. With |p| ≤ 2¹⁴ the normal and the edge functions, at
// any voxel of its bounds and 16 beyond, are below 2³⁰. The depth times |n_a|, a whole number below 2⁴⁵, is one that
// doubles hold; voxel_a = ⌊depth / den⌋, den = 256·|n_a|, is ⌊(depth + ½)/den⌋, whose argument is at least ½/den from any
// whole number, while quotients and sums in double are off by less than 2⁴⁵·2⁻⁵⁰/den.
#pragma once

#include <cstdint>

#include "gpu/assemble/line_walk.h"
#include "gpu/primitives/triangle.h"

namespace voxeld::gpu {

// Axes as in WalkGrid.
struct alignas(64) SmallTriangle {
  static constexpr int64_t kMostExtent = int64_t{1} << 14;

  int32_t origin[3];  // voxel of vertex 0
  uint32_t word;
  int32_t n[3];         // normal
  int16_t p[3][3];      // vertices
  int8_t lo[3], hi[3];  // bounds, in voxels

  // False if the triangle is none: large, far away, without area, of several colours, or to be covered. `word` is left to
  // the caller.
  static bool Of(const Triangle& t, const WalkGrid& grid, SmallTriangle& small) {
    if (t.rule != SurfaceRule::kThin || t.color[0] != t.color[1] || t.color[1] != t.color[2]) {
      return false;
    }
    int64_t p[3][3];
    for (int r = 0; r < 3; ++r) {
      const int a = grid.axis[r];
      const int64_t low = Min(t.v[0][a], Min(t.v[1][a], t.v[2][a]));
      const int64_t high = Max(t.v[0][a], Max(t.v[1][a], t.v[2][a]));
      if (high - low > kMostExtent - kUnitsPerVoxel || low < -kMostWalkUnits ||
          high > kMostWalkUnits) {
        return false;
      }
      const int64_t origin = VoxelOf(t.v[0][a]);
      small.origin[r] = static_cast<int32_t>(origin);
      small.lo[r] = static_cast<int8_t>(VoxelOf(low - 1) - origin);
      small.hi[r] = static_cast<int8_t>(VoxelOf(high) + 1 - origin);
      for (int i = 0; i < 3; ++i) {
        p[i][r] = t.v[i][a] - origin * kUnitsPerVoxel;
        small.p[i][r] = static_cast<int16_t>(p[i][r]);
      }
    }
    bool area = false;
    for (int r = 0; r < 3; ++r) {
      const int b = (r + 1) % 3, c = (r + 2) % 3;
      const int64_t n =
          (p[1][b] - p[0][b]) * (p[2][c] - p[0][c]) - (p[1][c] - p[0][c]) * (p[2][b] - p[0][b]);
      small.n[r] = static_cast<int32_t>(n);
      area |= n != 0;
    }
    return area;
  }
};

}  // namespace voxeld::gpu
