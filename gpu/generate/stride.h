// Computes voxel_k exactly, without a division for each k.
//
// There are three nested forms of S + (E−S)·k/N on one axis. Each is rounded up by a known amount,
// so its whole part can only be wrong if its fraction is smaller than that amount: then the next
// form is used.
//
//   Walk    32 fraction bits, one addition a step      start 1, each step 1 too large, in 2⁻³²
//   Stride  64 fraction bits, two multiplications      k·2⁻⁶⁴ too large; exact for N < 2²⁴, since
//           for any k                                  exact values are multiples of 1/(N·2¹⁶)
//   ExactCoordinate (segment.h)                        128 bits and a division
//
// A walk is biased by kWalkZone, so that values just below a whole number, which rounding could
// carry over it, end with a fraction below kWalkZone, and whole numbers do not: see `Doubtful`. If
// no value can lie so close below a whole number (N is small, or the end points are on whole
// voxels), or if the steps are exact, the bias is the whole zone; otherwise whole numbers are
// doubtful too.
//
// Host and device.
#pragma once

#include <cstdint>

#include "gpu/generate/segment.h"

namespace voxeld::gpu::generate {

inline constexpr int64_t kStrideExact = int64_t{1} << 24;

// 32 whole bits, 32 of fraction.
struct Walk {
  uint64_t at = 0, step = 0;
  VOXELD_HD int32_t whole() const { return static_cast<int32_t>(at >> 32); }
  VOXELD_HD uint32_t fraction() const { return static_cast<uint32_t>(at); }
};

struct Stride {
  uint64_t fraction = 0;       // of S
  uint64_t step_fraction = 0;  // of (E−S)/N, rounded up
  int32_t whole = 0, step_whole = 0;
  bool exact = true;  // 32 fraction bits hold the step

  // If n = 0, the stride does not move.
  VOXELD_HD static Stride Of(int64_t s, int64_t e, int64_t n) {
    Stride r;
    r.whole = static_cast<int32_t>(CellOf(s));
    r.fraction = static_cast<uint64_t>(s) << (64 - kFractionBits);
    if (n == 0) return r;
    const Wide length = (static_cast<Wide>(e) - s) * (Wide{1} << (64 - kFractionBits));
    const Wide step = CeilDiv<Wide>(length, n);
    r.exact = step * n == length && static_cast<uint32_t>(step) == 0;
    r.step_whole = static_cast<int32_t>(step >> 64);
    r.step_fraction = static_cast<uint64_t>(step);
    return r;
  }

  // Returns the whole part at k; `at_fraction` receives the fraction.
  VOXELD_HD int32_t At(uint32_t k, uint64_t* at_fraction) const {
    const uint64_t low = static_cast<uint64_t>(static_cast<uint32_t>(step_fraction)) * k;
    const uint64_t high = (step_fraction >> 32) * k;
    const uint64_t product = low + (high << 32);
    const uint64_t carry = product < low;
    const uint64_t sum = product + fraction;
    *at_fraction = sum;
    const uint64_t whole_part = (high >> 32) + carry + (sum < product);
    return static_cast<int32_t>(static_cast<uint32_t>(whole) +
                                static_cast<uint32_t>(step_whole) * k +
                                static_cast<uint32_t>(whole_part));
  }
};

// Returns a coordinate of voxel_k: from the stride if that is exact, otherwise from the definition.
VOXELD_HD inline int32_t CoordinateAt(const Stride& stride, int64_t s, int64_t e, int64_t n,
                                      int64_t k) {
  uint64_t fraction = 0;
  const int32_t whole = stride.At(static_cast<uint32_t>(k), &fraction);
  if (n >= kStrideExact && fraction < static_cast<uint64_t>(k)) return ExactCoordinate(s, e, n, k);
  return whole;
}

// How a walk of at most kLongest steps is biased.
template <uint32_t kLongest>
struct WalkRules {
  static constexpr uint32_t kTooLarge = kLongest + 3;  // greatest error in 2⁻³², at its last step
  static constexpr uint32_t kWalkZone = 2 * kTooLarge;  // fractions below it are doubtful

  // `grain`: end points are multiples of it, in units of 2⁻¹⁶ (65,536: whole voxels; 1: any).
  // Values are multiples of grain/(N·2¹⁶): a walk cannot be doubtful if N is so small that none of
  // them lies within the zone and all rounding below a whole number.
  VOXELD_HD static bool Apart(int64_t n, int64_t grain) {
    return (static_cast<uint64_t>(n) << kFractionBits) * (kWalkZone + kTooLarge) <
           (static_cast<uint64_t>(grain) << 32);
  }
  VOXELD_HD static uint32_t BiasOf(const Stride& stride, int64_t n, int64_t grain) {
    return stride.exact || Apart(n, grain) ? kWalkZone : kWalkZone - kTooLarge;
  }
  // Returns a walk from step k on, in steps of one.
  VOXELD_HD static Walk From(const Stride& stride, uint32_t k, uint32_t bias) {
    uint64_t fraction = 0;
    const int32_t whole = stride.At(k, &fraction);
    Walk walk;
    const uint32_t up = static_cast<uint32_t>(fraction) != 0;
    walk.at =
        (static_cast<uint64_t>(static_cast<uint32_t>(whole)) << 32) + (fraction >> 32) + up + bias;
    walk.step = StepOf(stride);
    return walk;
  }
  VOXELD_HD static uint64_t StepOf(const Stride& stride) {
    const uint32_t up = static_cast<uint32_t>(stride.step_fraction) != 0;
    return (static_cast<uint64_t>(static_cast<uint32_t>(stride.step_whole)) << 32) +
           (stride.step_fraction >> 32) + up;
  }
  // Returns `times` steps as one step: 1 too large, in 2⁻³².
  VOXELD_HD static uint64_t StepOfMany(const Stride& stride, uint32_t times) {
    const uint64_t low = static_cast<uint64_t>(static_cast<uint32_t>(stride.step_fraction)) * times;
    const uint64_t high = (stride.step_fraction >> 32) * times + (low >> 32);
    const uint32_t up = static_cast<uint32_t>(low) != 0;
    return (static_cast<uint64_t>(static_cast<uint32_t>(stride.step_whole) * times) << 32) + high +
           up;
  }
  VOXELD_HD static bool Doubtful(uint32_t fraction) { return fraction < kWalkZone; }
};

// Returns 65,536 if all end points are whole voxels, otherwise 1.
VOXELD_HD inline int64_t GrainOf(const FixedSegment& g) {
  uint64_t any = 0;
  for (int a = 0; a < 3; ++a) any |= static_cast<uint64_t>(g.s[a]) | static_cast<uint64_t>(g.e[a]);
  return (any & (kUnits - 1)) == 0 ? kUnits : 1;
}

}  // namespace voxeld::gpu::generate
