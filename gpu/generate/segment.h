// One segment in the generator's units: end points in units of 2⁻¹⁶ voxel, a number of steps, and
// the exact voxel at any step.
//
//   voxel_k = ⌊S + (E−S)·k/N⌋, k = 0..N, in exact rational arithmetic (the paper's equation (3));
//   EUCLIDEAN  N = ⌊|E−S|⌋ (the paper's (2))
//   THIN       N = max over axes of |⌊E⌋−⌊S⌋|: 26-connected, no voxel twice
//   COVER      the cells crossed from the lexicographically smaller end on (cover.h)
//
// If N = 0, the voxels of S and E are generated: two voxels are one step, a single one is none.
//
// Host and device. No decision uses floating point.
#pragma once

#include <cstdint>

#include "gpu/portable.h"
#include "gpu/primitives/fixed.h"

namespace voxeld::gpu::generate {

enum class Sampling : uint8_t { kEuclidean, kThin, kCover };

inline constexpr int kFractionBits = 16;
inline constexpr int64_t kUnits = int64_t{1} << kFractionBits;  // of a voxel
inline constexpr int64_t kMostCoordinate = int64_t{1} << 30;    // voxels, either sign
inline constexpr int64_t kMostSteps = int64_t{1} << 30;         // of one segment

struct Voxel {
  int32_t x = 0, y = 0, z = 0;
  friend bool operator==(const Voxel&, const Voxel&) = default;
};

struct FixedSegment {
  int64_t s[3] = {}, e[3] = {};  // in units, within ±kMostCoordinate voxels
};

VOXELD_HD constexpr int64_t CellOf(int64_t units) { return units >> kFractionBits; }

// ⌊√x⌋ for x < 2⁶².
VOXELD_HD inline int64_t FloorSqrt64(uint64_t x) {
  auto r = static_cast<int64_t>(SquareRoot(static_cast<double>(x)));
  while (static_cast<uint64_t>(r) * static_cast<uint64_t>(r) > x) --r;
  while (static_cast<uint64_t>(r + 1) * static_cast<uint64_t>(r + 1) <= x) ++r;
  return r;
}

// Returns ⌊|E−S|⌋ in voxels. ⌊√(q/2³²)⌋ = ⌊√⌊q/2³²⌋⌋.
VOXELD_HD inline int64_t FloorLength(const FixedSegment& g) {
  unsigned __int128 sum = 0;
  for (int a = 0; a < 3; ++a) {
    const Wide d = static_cast<Wide>(g.e[a]) - g.s[a];
    sum += static_cast<unsigned __int128>(d * d);
  }
  const unsigned __int128 whole = sum >> (2 * kFractionBits);
  if (whole >> 62 != 0) return FloorSqrt(static_cast<Wide>(whole));
  return FloorSqrt64(static_cast<uint64_t>(whole));
}

// Returns the number of steps, which is one less than the number of voxels.
VOXELD_HD inline int64_t StepsOf(const FixedSegment& g, Sampling sampling) {
  int64_t most = 0, sum = 0;
  for (int a = 0; a < 3; ++a) {
    const int64_t cells = Abs(CellOf(g.e[a]) - CellOf(g.s[a]));
    most = Max(most, cells);
    sum += cells;
  }
  if (sampling == Sampling::kCover) return sum;
  if (sampling == Sampling::kThin) return most;
  const int64_t n = FloorLength(g);
  return n == 0 && most > 0 ? 1 : n;
}

// Computes one coordinate of voxel_k from the definition. Requires: 0 ≤ k ≤ n, n > 0.
VOXELD_HD inline int32_t ExactCoordinate(int64_t s, int64_t e, int64_t n, int64_t k) {
  const Wide numerator = static_cast<Wide>(s) * n + (static_cast<Wide>(e) - s) * k;
  return static_cast<int32_t>(FloorDiv<Wide>(numerator, static_cast<Wide>(n) << kFractionBits));
}

}  // namespace voxeld::gpu::generate
