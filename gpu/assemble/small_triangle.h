// Triangles of at most 64 voxels' extent, in 32 bits relative to themselves: their faces (triangle_runs.h), by field.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "gpu/assemble/line_walk.h"
#include "gpu/primitives/triangle.h"

namespace voxeld::gpu {

// Axes as in WalkGrid. A face's are in the order of its roles: first one along which the normal is greatest, then that of
// its rows and that of its columns, of which rows are fewer.
struct SmallTriangles {
  static constexpr int64_t kMostExtent = int64_t{1} << 14;
  static constexpr size_t kRun = 64;  // triangles; made, and followed while they are in the cache
  static constexpr size_t kMost = kRun + 2;
  static constexpr size_t kRoom = kMost + 14;  // whole vectors

  size_t size = 0;
  int32_t axis[3][kRoom];    // by role
  int32_t origin[3][kRoom];  // the voxel of the bounds' lower corner; what is lit lies from there
  int32_t voxels[3][kRoom];  // to origin + voxels − 1, 1 to 64
  int32_t p[3][3][kRoom];    // by role: vertices, in units from the origin, 0 ≤ p < 2¹⁴
  int32_t n[3][kRoom];       // normal: |n| < 2²⁹
  int32_t cyclic[kRoom];     // all ones where columns' axis follows the first; else 0
  int32_t whole[kRoom];      // all ones for one face of a triangle; else 0
  uint32_t word[kRoom];      // of its voxels

  bool full() const { return size >= kRun; }

  // False if the triangle is none: large, far away, without area, of several colours, or to be covered. Not if it is full.
  bool Add(const Triangle& t, const WalkGrid& grid, uint32_t of_word) {
    if (t.rule != SurfaceRule::kThin || !t.IsOfOneColor()) {
      return false;
    }
    int64_t from[3];
    int32_t extent[3], corner[3][3], normal[3];
    for (int r = 0; r < 3; ++r) {
      const int a = grid.axis[r];
      const int64_t low = Min(t.v[0][a], Min(t.v[1][a], t.v[2][a]));
      const int64_t high = Max(t.v[0][a], Max(t.v[1][a], t.v[2][a]));
      if (high - low > kMostExtent - kUnitsPerVoxel || low < -kMostWalkUnits ||
          high > kMostWalkUnits) {
        return false;
      }
      from[r] = VoxelOf(low);
      extent[r] = static_cast<int32_t>(VoxelOf(high) - from[r]) + 1;
      for (int i = 0; i < 3; ++i) {
        corner[r][i] = static_cast<int32_t>(t.v[i][a] - from[r] * kUnitsPerVoxel);
      }
    }
    int32_t greatest = 0;
    for (int r = 0; r < 3; ++r) {
      const int32_t *const b = corner[(r + 1) % 3], *const c = corner[(r + 2) % 3];
      normal[r] = (b[1] - b[0]) * (c[2] - c[0]) - (c[1] - c[0]) * (b[2] - b[0]);
      greatest = std::max(greatest, Abs(normal[r]));
    }
    if (greatest == 0) return false;
    int32_t all = -1;
    for (int r = 0; r < 3; ++r) {
      if (Abs(normal[r]) != greatest) continue;
      const bool swap = extent[(r + 1) % 3] > extent[(r + 2) % 3];
      const int roles[3] = {r, (r + (swap ? 2 : 1)) % 3, (r + (swap ? 1 : 2)) % 3};
      for (int role = 0; role < 3; ++role) {
        const int x = roles[role];
        axis[role][size] = x;
        origin[role][size] = static_cast<int32_t>(from[x]);
        voxels[role][size] = extent[x];
        for (int i = 0; i < 3; ++i) p[role][i][size] = corner[x][i];
        n[role][size] = normal[x];
      }
      cyclic[size] = swap ? -1 : 0;
      whole[size] = all;
      word[size++] = of_word;
      all = 0;
    }
    return true;
  }

  // Behind the last face the first again, up to a multiple of `lanes` ≤ 16.
  void Pad(size_t lanes) {
    for (size_t i = size; i % lanes != 0; ++i) {
      for (int r = 0; r < 3; ++r) {
        axis[r][i] = axis[r][0];
        origin[r][i] = origin[r][0];
        voxels[r][i] = voxels[r][0];
        for (auto& vertex : p[r]) vertex[i] = vertex[0];
        n[r][i] = n[r][0];
      }
      cyclic[i] = cyclic[0];
      whole[i] = whole[0];
      word[i] = word[0];
    }
  }
};

}  // namespace voxeld::gpu
