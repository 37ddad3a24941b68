// Divides a turn into steps: which step contains an angle, and how near the next one is.
#pragma once

#include <cstdint>

#include "display/api/slice_frame.h"
#include "display/geometry/angle.h"
#include "display/geometry/weight_between.h"

namespace voxeld::display {

// Calls each(step, weight): step s covers [s − ½, s + ½) / steps of a turn; if weighted, also for
// the step beside it.
template <typename Each>
void ForEachStepAt(Turn since_start, uint32_t steps, Sampling sampling, Each&& each) {
  const uint64_t progress = static_cast<uint64_t>(since_start) * steps + (uint64_t{1} << 31);
  const uint32_t step = static_cast<uint32_t>(progress >> 32) % steps;
  each(step, kFullWeight);
  if (sampling != Sampling::kWeighted) return;
  // Distance from the middle of the step, in 2⁻³² step: −½ to ½.
  const int64_t offset = static_cast<int64_t>(progress & 0xFFFFFFFF) - (int64_t{1} << 31);
  const uint64_t distance = static_cast<uint64_t>(offset < 0 ? -offset : offset);
  const uint16_t beside = WeightBetween((uint64_t{1} << 32) - distance, distance);
  if (beside > 0) each((step + (offset < 0 ? steps - 1 : 1)) % steps, beside);
}

}  // namespace voxeld::display
