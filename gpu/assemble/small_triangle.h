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

// The separating axes of a small triangle, for any number of tiles; whole numbers below 2⁵³ in doubles.
class SmallTriangleSlabs {
 public:
  explicit SmallTriangleSlabs(const Triangle& t) {
    double e[3][3], p[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int a = 0; a < 3; ++a) {
        p[i][a] = static_cast<double>(t.v[i][a]);
        e[i][a] = static_cast<double>(t.v[i == 2 ? 0 : i + 1][a] - t.v[i][a]);
      }
    }
    plane_ = 0;
    reach_ = 0;
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      normal_[a] = e[0][b] * e[1][c] - e[0][c] * e[1][b];
      plane_ += normal_[a] * p[0][a];
      reach_ += Abs(normal_[a]) * kHalf;
      for (int i = 0; i < 3; ++i) {
        const double u = -e[i][c], w = e[i][b];
        const double edge = u * p[i][b] + w * p[i][c];
        const double third = u * p[(i + 2) % 3][b] + w * p[(i + 2) % 3][c];
        const double r = (Abs(u) + Abs(w)) * kHalf;
        edges_[a][i] = {u, w, Min(edge, third) - r, Max(edge, third) + r};
      }
    }
  }

  // Whether the triangle may meet the tile.
  bool MayMeet(int32_t i, int32_t j, int32_t k) const {
    const double centre[3] = {(i + 0.5) * kTile, (j + 0.5) * kTile, (k + 0.5) * kTile};
    const double off =
        normal_[0] * centre[0] + normal_[1] * centre[1] + normal_[2] * centre[2] - plane_;
    if (Abs(off) > reach_) return false;
    bool meets = true;
    for (int a = 0; a < 3; ++a) {
      const double b = centre[(a + 1) % 3], c = centre[(a + 2) % 3];
      for (const Edge& edge : edges_[a]) {
        const double f = edge.u * b + edge.w * c;
        meets &= f >= edge.low && f <= edge.high;
      }
    }
    return meets;
  }

 private:
  static constexpr double kTile = static_cast<double>(kTileSize * kUnitsPerVoxel);
  static constexpr double kHalf = kTile / 2 + 1;  // closed boxes, and the voxels that they touch

  struct Edge {
    double u, w, low, high;
  };
  double normal_[3], plane_, reach_;
  Edge edges_[3][3];
};

}  // namespace voxeld::gpu
