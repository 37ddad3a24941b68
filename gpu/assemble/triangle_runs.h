// A small triangle as runs of columns, worked out once for all the tiles that it is in: exactly the voxels of THIN
// (primitives/triangle.h).
//
// Let a be an axis along which the normal n is greatest, u and v the others. In row k (of u) the columns j (of v) whose
// centres lie in the triangle's projection are a run, first to end − 1, and each lights one voxel, ⌊depth⌋, the triangle's
// *face*. A line along v through the centre of voxel (k, j, i) that meets the triangle t from that centre, −½ ≤ t < ½, is
// t·|n_v/n_a| < ½ away from it along a if |n_v| < |n_a|: so i is ⌊depth⌋ of column j, too. That point lies over row k at
// j + t. So if the run does not have column j, then j is first − 1 or end: what lines along v add to a face are at
// most two voxels a row, which make the run longer, and what lines along u add at most two a column: all of them at the
// depth of their columns. Where |n_v| = |n_a| the lines along v make another face. Voxels of vertices that are not at the
// depth of their columns are kept by themselves.
//
// Whole numbers: vertices are below 2¹⁴ units, n below 2²⁹, edge functions at any voxel of the bounds below 2³⁰, and the
// depth's numerator N = |n_a|·depth below 2⁴⁵, which doubles hold. A quotient by |n_a| in 2⁻²⁵ voxel is below 2³⁴: a double
// is off by less than 2⁻¹⁷, so that the remainder at the nearest whole number is below 0.51·|n_a| and known modulo 2³².
//
// Depths: D(k, j) = depth + k·fall_u + j·fall_v in 2⁻²⁵ voxel, modulo 2³². The three are rounded up, so
// 0 ≤ D − true < err, err the number of roundings that were not exact: one for the start, one for each row and each column
// at most. D lies in the same voxel as the true depth unless its fraction is below err; there, in a column of hundreds of
// thousands or where a plane falls by thirds of voxels and meets corners, the definition's division decides.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/assemble/buffer.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

inline constexpr int kDepthBits = 25;

// Of several faces: the depth's numerator N at row 0, column 0, and |n_a|, which are seldom asked for.
struct alignas(64) ExactDepths {
  static constexpr size_t kMost = 16;
  double numerator[kMost];               // whole
  int32_t step_u[kMost], step_v[kMost];  // N's, in voxels: times 256
  int32_t divisor[kMost];                // times 256
};

// A face. Faces are made several at once and lie one behind the other; behind them their exact depths, by field, and their
// rows. Axes and voxels as in SmallTriangles.
struct alignas(64) TriangleRuns {
  int32_t origin[3];  // by role
  uint32_t word;
  uint32_t depth, fall_u, fall_v, err;  // 2⁻²⁵ voxel
  // Voxels of vertices that no column has, eight bits an axis in the order of a tile's memory; or none.
  static constexpr uint32_t kNoVertex = 0x808080;
  uint32_t vertices[3];
  uint32_t axes;     // two bits each, by role; and kNoVertex
  uint32_t rows_at;  // from the face on, in words
  uint32_t more;  // from a row on, the words to its columns from the 32nd on; 0 if there are none
  uint32_t exact_at;  // from the face on, in units
  uint32_t exact_lane;

  int axis(int role) const { return static_cast<int>(axes >> (2 * role) & 3); }
  // Of each row the columns, bit j column j.
  const uint32_t* rows() const { return reinterpret_cast<const uint32_t*>(this) + rows_at; }
  const ExactDepths& exact() const {
    return *reinterpret_cast<const ExactDepths*>(this + exact_at);
  }
};
static_assert(sizeof(TriangleRuns) == 64);

// Triangles of a part of a drawable's items.
struct TriangleMemory {
  Buffer<TriangleRuns> units;
  size_t size = 0;
};

}  // namespace voxeld::gpu
