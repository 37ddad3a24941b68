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
// depth's numerator N = |n_a|·depth below 2⁴⁵. ⌊x/d⌋ of whole numbers, x below 2⁴⁵, is ⌊(x + ½)·(1/d)⌋ in double: the
// argument is at least ½/d away from whole numbers and off by less than 2⁴⁵·2⁻⁵⁰/d.
//
// Depths: D(k, j) = depth + k·fall_u + j·fall_v in 2⁻²⁵ voxel, modulo 2³². The three are rounded up, so
// 0 ≤ D − true < err, err the number of roundings that were not exact: one for the start, one for each row and each column
// at most. D lies in the same voxel as the true depth unless its fraction is below err; there, in a column of hundreds of
// thousands or where a plane falls by thirds of voxels and meets corners, the definition's division decides.
#pragma once

#include <cstdint>

#include "gpu/assemble/buffer.h"
#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

inline constexpr int kDepthBits = 25;

// The depth's numerator N, and |n_a|.
struct ExactDepth {
  int64_t numerator;       // at row 0, column 0
  int32_t step_u, step_v;  // in voxels: times 256
  int32_t divisor;         // times 256
};

// A face. Behind it, for each tile along v from the one that holds the origin on, `stride` rows of 16 columns (bit 0 the
// tile's first): those that have a voxel; then the exact depth, which is seldom asked for. Axes as in WalkGrid; voxels
// from `origin`.
struct alignas(64) TriangleRuns {
  int32_t origin[3];
  uint32_t word;
  uint32_t depth, fall_u, fall_v, err;  // 2⁻²⁵ voxel
  // Voxels of vertices that no column has, eight bits an axis; or none. The last is none.
  static constexpr uint32_t kNoVertex = 0x808080;
  uint32_t vertices[4];
  uint8_t a, u, v, rows;
  uint8_t stride;  // `rows`, up to a multiple of 16
  uint8_t tiles;

  const uint16_t* columns(int32_t tile) const {
    return reinterpret_cast<const uint16_t*>(this + 1) + tile * stride;
  }
  uint16_t* columns(int32_t tile) { return reinterpret_cast<uint16_t*>(this + 1) + tile * stride; }
  const ExactDepth& exact() const { return *reinterpret_cast<const ExactDepth*>(columns(tiles)); }
  ExactDepth& exact() { return *reinterpret_cast<ExactDepth*>(columns(tiles)); }
  size_t units() const { return 1 + (size_t{tiles} * stride * 2 + sizeof(ExactDepth) + 63) / 64; }
  static constexpr size_t kMostUnits = 1 + (5 * 64 * 2 + sizeof(ExactDepth) + 63) / 64;
};
static_assert(sizeof(TriangleRuns) == 64);

// Triangles of a part of a drawable's items, each beginning at a unit.
struct TriangleMemory {
  Buffer<TriangleRuns> units;
  size_t size = 0;
};

}  // namespace voxeld::gpu
