// COVER: computes the k-th of the cells that a segment crosses, 6-connected, independently for any
// k.
//
// Crossing i = 0..n_a−1 of axis a takes place at t = (p_a + i)/|D_a| (in units of 2⁻¹⁶), where p_a
// is the distance to the first face. Crossings are ordered by (t, axis), x before y before z, and
// the k-th cell is reached after the first k of them. The three sequences are merged by rank: t =
// k/N, corrected, says how many crossings of each axis are among the first k.
//
// Host and device.
#pragma once

#include <cstdint>

#include "gpu/generate/segment.h"

namespace voxeld::gpu::generate {

struct Cover {
  int64_t cell[3], direction[3], count[3], first[3], length[3];

  VOXELD_HD static Cover Of(const FixedSegment& g) {
    bool forward = true;
    for (int a = 0; a < 3; ++a) {
      if (g.s[a] == g.e[a]) continue;
      forward = g.s[a] < g.e[a];
      break;
    }
    Cover c;
    for (int a = 0; a < 3; ++a) {
      const int64_t from = forward ? g.s[a] : g.e[a], to = forward ? g.e[a] : g.s[a];
      c.cell[a] = CellOf(from);
      c.direction[a] = to >= from ? 1 : -1;
      c.count[a] = Abs(CellOf(to) - c.cell[a]);
      c.first[a] = to >= from ? (c.cell[a] + 1) * kUnits - from : from - c.cell[a] * kUnits;
      c.length[a] = Abs(to - from);
    }
    return c;
  }

  VOXELD_HD int64_t steps() const { return count[0] + count[1] + count[2]; }

  // Returns whether crossing i of axis a comes before crossing j of axis b.
  VOXELD_HD bool Before(int a, int64_t i, int b, int64_t j) const {
    const Wide left = static_cast<Wide>(first[a] + i * kUnits) * length[b];
    const Wide right = static_cast<Wide>(first[b] + j * kUnits) * length[a];
    return left < right || (left == right && a < b);
  }

  // Computes how many crossings of each axis are among the first k. Requires: 0 ≤ k ≤ steps().
  VOXELD_HD void Find(int64_t k, int64_t (&taken)[3]) const {
    // The guess is the point at which about k faces have been crossed. For each axis it is off by
    // at most one or two.
    int64_t sum = 0;
    const int64_t all = length[0] + length[1] + length[2];
    for (int a = 0; a < 3; ++a) {
      int64_t guess = 0;
      if (all > 0) {
        // The units of this axis at that point, minus those to its first face.
        const Wide units = static_cast<Wide>(length[a]) * k * kUnits / all;
        guess = units < first[a] ? 0 : static_cast<int64_t>((units - first[a]) / kUnits) + 1;
      }
      taken[a] = Min(guess, count[a]);
      sum += taken[a];
    }
    // Exchange crossings until those taken are the first `sum`: no taken crossing comes after one
    // that is left.
    for (;;) {
      const int last = Last(taken), next = Next(taken);
      if (last < 0 || next < 0 || !Before(next, taken[next], last, taken[last] - 1)) break;
      --taken[last];
      ++taken[next];
    }
    for (; sum > k; --sum) --taken[Last(taken)];
    for (; sum < k; ++sum) ++taken[Next(taken)];
  }
  // Advances from the first k crossings to the first k + 1.
  VOXELD_HD void Step(int64_t (&taken)[3]) const {
    const int next = Next(taken);
    if (next >= 0) ++taken[next];
  }
  VOXELD_HD Voxel CellAfter(const int64_t (&taken)[3]) const {
    return {static_cast<int32_t>(cell[0] + direction[0] * taken[0]),
            static_cast<int32_t>(cell[1] + direction[1] * taken[1]),
            static_cast<int32_t>(cell[2] + direction[2] * taken[2])};
  }

 private:
  // Returns the axis of the last crossing among those taken; −1 if none is taken.
  VOXELD_HD int Last(const int64_t (&taken)[3]) const {
    int last = -1;
    for (int a = 0; a < 3; ++a) {
      if (taken[a] == 0) continue;
      if (last < 0 || Before(last, taken[last] - 1, a, taken[a] - 1)) last = a;
    }
    return last;
  }
  // Returns the axis of the first crossing that is left; −1 if none is left.
  VOXELD_HD int Next(const int64_t (&taken)[3]) const {
    int next = -1;
    for (int a = 0; a < 3; ++a) {
      if (taken[a] == count[a]) continue;
      if (next < 0 || Before(a, taken[a], next, taken[next])) next = a;
    }
    return next;
  }
};

}  // namespace voxeld::gpu::generate
