// The motion of a reciprocating screen, as the places of its slices.
#pragma once

#include <cstdint>
#include <vector>

namespace voxeld::display {

// One stroke, whose slices are shown evenly in time.
struct Motion {
  enum class Kind : uint8_t {
    kStepped,   // slice_pitch_mm apart, independent of time
    kSawtooth,  // at constant speed
    kSine,      // from standstill to standstill, as a crank drives it
  };
  Kind kind = Kind::kStepped;
  int32_t slices = 1;         // 1 or more
  double slice_pitch_mm = 1;  // kStepped only
  // For the other kinds:
  double travel_mm = 1;   // from end to end, symmetric about 0
  double dead_begin = 0;  // shares of the stroke's time in which nothing is lit; together below 1
  double dead_end = 0;
  bool down = false;
};

// Returns the places of a stroke's slices, in the order in which they are sent: each at the middle
// of its time.
std::vector<double> PositionsOf(const Motion& motion);

}  // namespace voxeld::display
