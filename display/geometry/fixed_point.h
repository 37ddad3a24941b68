// Converts millimetres to integers: in one place, by IEEE operations alone.
#pragma once

#include <cstdint>
#include <optional>

namespace voxeld::display {

// A position in units of 2⁻¹⁶ voxel.
using Fixed = int64_t;
inline constexpr int kFixedBits = 16;
inline constexpr Fixed kFixedOne = Fixed{1} << kFixedBits;
inline constexpr Fixed kFixedHalf = kFixedOne / 2;

// Returns ⌊value + ½⌋. Requires: |value| < 2⁶².
inline int64_t RoundHalfUp(double value) {
  const double raised = value + 0.5;
  const int64_t truncated = static_cast<int64_t>(raised);
  return truncated - (raised < static_cast<double>(truncated) ? 1 : 0);
}

// Converts a length or position in millimetres to cells of `pitch_mm`.
inline Fixed ToFixed(double mm, double pitch_mm) { return RoundHalfUp(mm / pitch_mm * 65536.0); }

// The same for any place, including NaN: returns nothing if it is 2²⁴ cells away or farther.
inline std::optional<Fixed> ToFixedNear(double mm, double pitch_mm) {
  constexpr double kFar = 16777216;
  if (!(mm / pitch_mm > -kFar && mm / pitch_mm < kFar)) return std::nullopt;
  return ToFixed(mm, pitch_mm);
}

}  // namespace voxeld::display
