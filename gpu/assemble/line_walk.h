// A line as a walk in fixed point: its voxels by additions, exactly those of primitives/line.h.
//
// voxel_k = ⌊S + (E−S)·k/N⌋ (THIN and EUCLIDEAN), axis by axis. With S in units of 2⁻⁸ voxel every such position is a
// multiple of 1/(256·N), so one that is too large by less than that lies in the same voxel.
//   P(k) = at + k·step, in 2⁻³² voxel: `at` is S; `step` is too large by 1 + 2⁻¹⁷ at most, so P(N) by N·(1 + 2⁻¹⁷)·2⁻³².
//   In a tile of 16 voxels: 5.27 fixed point, ⌊P(k0)/2⁵⌋ + 1 and ⌊step/2⁵⌋ + 1 a step: each too large by 2⁻²⁷ at most,
//   in the tile's first kMostInTile voxels by kMostInTile·2⁻²⁷. Whole numbers beyond the tile do not matter, so this is
//   done modulo 2³²: ⌊P(k0)/2⁵⌋ = S·2¹⁹ + k0·⌊step/2⁵⌋ + ⌊k0·(step mod 2⁵)/2⁵⌋.
// Together less than 1/(256·N) for N ≤ kMostWalkSteps = 3072: 7.2·10⁻⁷ + 2.5·10⁻⁷ < 12.7·10⁻⁷.
// A tile holds no more than that of consecutive k: along some axis the walk takes a step of more than (N−1)/N voxel
// (THIN) or of 1/√3 (EUCLIDEAN), so it has left after 18, or 29.
//
// Where P enters a tile: at the smallest k with P(k) ≥ B, B the tile's face (for a walk down, all is reflected: ~P goes
// up). q = (B − at)/step is a multiple of 1/step ≥ 2⁻³³·⁰¹, so ⌈q⌉ = ⌈q' − 2⁻³⁶⌉ for the q' that doubles give: numerator and
// step are exact, reciprocal and product are off by less than 4097·2⁻⁵¹ < 2⁻³⁸.
#pragma once

#include <cstdint>

#include "gpu/primitives/grid.h"
#include "gpu/primitives/line.h"

namespace voxeld::gpu {

inline constexpr int64_t kMostWalkSteps = 3072;
inline constexpr int32_t kMostInTile = 33;
// Coordinates of walks, in units: in 2⁻³² voxel doubles still hold them.
inline constexpr int64_t kMostWalkUnits = int64_t{1} << 26;

// A grid with its axes as they lie in a tile's memory, the fastest first.
struct WalkGrid {
  int axis[3];
  int32_t voxels[3];
  int32_t tile_step[3];  // from a tile's number to the next one's along the axis

  explicit WalkGrid(const TileGrid& grid) {
    const int32_t steps[3] = {1, grid.tiles[0], grid.tiles[0] * grid.tiles[1]};
    for (int a = 0; a < 3; ++a) {
      const auto rank = static_cast<size_t>(grid.shift[a] / kTileBits);
      axis[rank] = a;
      voxels[rank] = grid.voxels[a];
      tile_step[rank] = steps[a];
    }
  }
};

// Axes as in WalkGrid. Half a cache line: tiles read the walks of their spans from all over.
struct alignas(32) LineWalk {
  int32_t start[3];   // S, units
  uint32_t word;      // of its voxels
  int32_t stride[3];  // ⌊step/2⁵⌋ + 1
  uint32_t rest;      // step mod 2⁵ of axis r in the five bits from 5·r on; N from bit 16 on

  int64_t at(int r) const { return int64_t{start[r]} * (int64_t{1} << 24); }
  int64_t step(int r) const { return int64_t{stride[r] - 1} * 32 + (rest >> (5 * r) & 31); }
  int64_t steps() const { return rest >> 16; }  // N

  // False if the line is none: of another kind, too long, too far away, or of two colours. `word` is left to the caller.
  static bool Of(const Line& line, const WalkGrid& grid, LineWalk& walk) {
    if (line.sampling == LineSampling::kCover || line.color_s != line.color_e) return false;
    int64_t d[3], n = 0, most = 0;
    for (int r = 0; r < 3; ++r) {
      const int64_t s = line.s[grid.axis[r]], e = line.e[grid.axis[r]];
      most = Max(most, Max(Abs(s), Abs(e)));
      walk.start[r] = static_cast<int32_t>(s);
      d[r] = e - s;
      n = Max(n, Abs(VoxelOf(e) - VoxelOf(s)));
    }
    if (most > kMostWalkUnits || n > kMostWalkSteps) return false;
    if (line.sampling == LineSampling::kEuclidean) {
      const bool one_voxel = n == 0;
      n = LineSteps(line);
      if ((n == 0 && !one_voxel) || n > kMostWalkSteps) return false;
    }
    walk.rest = static_cast<uint32_t>(n) << 16;
    // 2²⁴/N and the product are rounded: |D|·2²⁴/N < 2³³·⁰¹, so by less than 2⁻¹⁸·⁹ in all.
    const double part = n == 0 ? 0.0 : 16777216.0 / static_cast<double>(n);
    for (int r = 0; r < 3; ++r) {
      const int64_t step = n == 0 ? 0 : FloorToInt(static_cast<double>(d[r]) * part + 0x1p-18) + 1;
      walk.stride[r] = static_cast<int32_t>(step >> 5) + 1;
      walk.rest |= static_cast<uint32_t>(step & 31) << (5 * r);
    }
    return true;
  }
};

}  // namespace voxeld::gpu
