#include "display/geometry/motion.h"

#include "display/geometry/angle.h"

namespace voxeld::display {

std::vector<double> PositionsOf(const Motion& motion) {
  std::vector<double> positions;
  const bool stepped = motion.kind == Motion::Kind::kStepped;
  const double time = 1 - motion.dead_begin - motion.dead_end;
  for (int32_t s = 0; s < motion.slices; ++s) {
    if (stepped) {
      positions.push_back((s - (motion.slices - 1) / 2.0) * motion.slice_pitch_mm);
    } else {
      const double at = motion.dead_begin + (s + 0.5) / motion.slices * time;
      // Position after half a turn of the crank.
      const double way =
          motion.kind == Motion::Kind::kSine
              ? 0.5 - 0.5 * (DirectionOf(TurnFromFraction(at / 2)).cos / 1073741824.0)
              : at;
      positions.push_back((way - 0.5) * motion.travel_mm);
    }
    if (motion.down) positions.back() = -positions.back();
  }
  return positions;
}

}  // namespace voxeld::display
