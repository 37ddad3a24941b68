// Integer angles, sines, cosines and arc tangents: the same bits on every machine.
#pragma once

#include <cstdint>

namespace voxeld::display {

// An angle in units of 2⁻³² turn, counter-clockwise; sums and differences wrap around as turns do.
using Turn = uint32_t;

// Returns `turns`, in [0, 1), as an angle, rounded half up.
Turn TurnFromFraction(double turns);

// Returns part/whole of a turn, rounded half up. Requires: 0 ≤ part < whole.
Turn TurnFromRatio(uint32_t part, uint32_t whole);

// In units of 2⁻³⁰, rounded to nearest (within 0.51 units of the true value). Quarter turns are
// exact, and the symmetries of the circle hold exactly.
struct Direction {
  int32_t cos, sin;
};
Direction DirectionOf(Turn turn);

// Returns the angle of (x, y), within 0.51·2⁻³² turn; symmetric under quarter turns. Requires: |x|,
// |y| < 2⁶²; not both 0.
Turn TurnOf(int64_t x, int64_t y);

// Returns ⌊√n⌋, exactly. Requires: n < 2⁶².
int64_t FloorSqrt(int64_t n);

}  // namespace voxeld::display
