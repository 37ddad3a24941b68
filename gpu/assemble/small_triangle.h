// A triangle of at most 64 voxels' extent, in 32 bits relative to itself.
#pragma once

#include <cstdint>

#include "gpu/assemble/line_walk.h"
#include "gpu/primitives/triangle.h"

namespace voxeld::gpu {

// Axes as in WalkGrid. What it lights lies in voxels origin to origin + size − 1.
struct SmallTriangle {
  static constexpr int64_t kMostExtent = int64_t{1} << 14;

  int32_t origin[3];  // the voxel of its bounds' lower corner
  int32_t size[3];    // voxels, 1 to 64
  int32_t
      p[3][4];  // by axis: vertices, the first again at the end; units from the origin, 0 ≤ p < 2¹⁴
  int32_t n[3];   // normal: |n| < 2²⁹
  uint32_t word;  // of its voxels

  // False if the triangle is none: large, far away, without area, of several colours, or to be covered. `word` is left to
  // the caller.
  static bool Of(const Triangle& t, const WalkGrid& grid, SmallTriangle& small) {
    if (t.rule != SurfaceRule::kThin || t.color[0] != t.color[1] || t.color[1] != t.color[2]) {
      return false;
    }
    for (int r = 0; r < 3; ++r) {
      const int a = grid.axis[r];
      const int64_t low = Min(t.v[0][a], Min(t.v[1][a], t.v[2][a]));
      const int64_t high = Max(t.v[0][a], Max(t.v[1][a], t.v[2][a]));
      if (high - low > kMostExtent - kUnitsPerVoxel || low < -kMostWalkUnits ||
          high > kMostWalkUnits) {
        return false;
      }
      const int64_t origin = VoxelOf(low);
      small.origin[r] = static_cast<int32_t>(origin);
      small.size[r] = static_cast<int32_t>(VoxelOf(high) - origin) + 1;
      for (int i = 0; i < 4; ++i) {
        small.p[r][i] = static_cast<int32_t>(t.v[i % 3][a] - origin * kUnitsPerVoxel);
      }
    }
    int32_t area = 0;
    for (int r = 0; r < 3; ++r) {
      const int32_t *const b = small.p[(r + 1) % 3], *const c = small.p[(r + 2) % 3];
      small.n[r] = (b[1] - b[0]) * (c[2] - c[0]) - (c[1] - c[0]) * (b[2] - b[0]);
      area |= small.n[r];
    }
    return area != 0;
  }
};

}  // namespace voxeld::gpu
