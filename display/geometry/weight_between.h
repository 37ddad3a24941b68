// The weight of a voxel between two slices.
#pragma once

#include <cstdint>

#include "display/geometry/footprint.h"

namespace voxeld::display {

// Returns its weight in the footprints of a slice at distance `here`, when the neighbour on the
// other side of the voxel is at distance `there`: full in the nearer slice (in both, half-way
// between them), and in the farther one ⌊255·there/here + ½⌋. So the two weights' ratio gives the
// exact place of the voxel, and one of them is always full. Any unit; each < 2⁵⁴.
constexpr uint16_t WeightBetween(uint64_t here, uint64_t there) {
  if (here <= there) return kFullWeight;
  return static_cast<uint16_t>((2 * kFullWeight * there + here) / (2 * here));
}

}  // namespace voxeld::display
