// How a screen moves to and fro, as the places of its slices.
#pragma once

#include <cstdint>
#include <vector>

namespace voxeld::display {

// One stroke, of which slices are shown evenly in time.
struct Motion {
  enum class Kind : uint8_t {
    kStepped,   // slice_pitch_mm apart, whatever the time
    kSawtooth,  // at one speed
    kSine,      // from standstill to standstill, as a crank drives it
  };
  Kind kind = Kind::kStepped;
  int32_t slices = 1;         // 1 or more
  double slice_pitch_mm = 1;  // of kStepped alone
  // Of the others:
  double travel_mm = 1;   // from end to end, about 0
  double dead_begin = 0;  // shares of the stroke's time in which nothing is lit; together below 1
  double dead_end = 0;
  bool down = false;
};

// Where the slices of a stroke are, in the order in which they go out: at the middle of each one's time.
std::vector<double> PositionsOf(const Motion& motion);

}  // namespace voxeld::display
