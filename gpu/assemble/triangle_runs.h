// A small triangle as runs of columns, worked out once for all the tiles that it is in: exactly the voxels of THIN
// (primitives/triangle.h).
//
// Let a be an axis along which the normal n is greatest, u and v the others. In row k (of u) the columns j (of v) whose
// centres lie in the triangle's projection are a run, first to end − 1, and each lights one voxel, ⌊depth⌋, the triangle's
// *face*. A line along v through the centre of voxel (k, j, i) that meets the triangle t from that centre, −½ ≤ t < ½, is
// t·|n_v/n_a| < ½ away from it along a if |n_v| < |n_a|: so i is ⌊depth⌋ of column j, too. That point lies over row k at
// j + t. So if the run does not have column j, then j is first − 1 or end: what lines along v add to a face are at
// most two voxels a row, what lines along u add at most two a column, and each of those is tested by the definition.
// These and the vertices' voxels are the triangle's *singles*. Where |n_v| = |n_a| the lines along v make another face.
//
// Whole numbers: vertices are below 2¹⁴ units, n below 2²⁹, edge functions at any voxel of the bounds below 2³⁰, and the
// depth's numerator N = |n_a|·depth below 2⁴⁵: exact in double. ⌊x/d⌋ of whole numbers is ⌊(x + ½)·(1/d)⌋ in double: the
// argument is at least ½/d away from whole numbers and off by less than 2⁴⁵·2⁻⁵⁰/d.
//
// Depths in a tile: D(k, j) = depth + k·fall_u + j·fall_v in 2⁻²⁵ voxel, modulo 2³². The three are rounded up, so
// 0 ≤ D − true < err, err the number of roundings that were not exact: one for the start, one for each row and each column
// at most. D lies in the same voxel as the true depth unless its fraction is below err; there, in a column of four millions
// or where a plane falls by thirds of voxels and touches corners, the definition's division decides.
#pragma once

#include <cstdint>

#include "gpu/assemble/buffer.h"

namespace voxeld::gpu {

inline constexpr int kDepthBits = 25;

// A face. Behind it `rows` runs (a 16-bit word each: first in the lower, end in the upper half, ≤ 64), then, from the
// next multiple of four bytes on, `singles` voxels of eight bits an axis. Axes as in WalkGrid; voxels from `origin`.
struct alignas(64) TriangleRuns {
  int32_t origin[3];
  uint32_t word;
  uint32_t depth, fall_u, fall_v, err;  // 2⁻²⁵ voxel
  int64_t numerator;                    // N at row 0, column 0
  int32_t step_u, step_v;               // N's, in voxels: times 256
  int32_t divisor;                      // |n_a|: times 256
  uint8_t a, u, v, rows;
  uint16_t singles;

  const uint16_t* runs() const { return reinterpret_cast<const uint16_t*>(this + 1); }
  const uint32_t* voxels() const {
    return reinterpret_cast<const uint32_t*>(runs() + (rows + 1) / 2 * 2);
  }
};
static_assert(sizeof(TriangleRuns) == 64);

// Triangles of a part of a drawable's items, each beginning at a unit.
struct TriangleMemory {
  Buffer<TriangleRuns> units;
  size_t size = 0;
};

}  // namespace voxeld::gpu
