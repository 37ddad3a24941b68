#include "display/geometry/motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace voxeld::display {
namespace {

using ::testing::ElementsAre;

TEST(Motion, SteppedIsEven) {
  EXPECT_THAT(PositionsOf({.slices = 4, .slice_pitch_mm = 0.5}),
              ElementsAre(-0.75, -0.25, 0.25, 0.75));
  EXPECT_THAT(PositionsOf({.slices = 3, .slice_pitch_mm = 2, .down = true}), ElementsAre(2, 0, -2));
}

TEST(Motion, SawtoothLeavesOutItsDeadZones) {
  EXPECT_THAT(PositionsOf({.kind = Motion::Kind::kSawtooth,
                           .slices = 4,
                           .travel_mm = 16,
                           .dead_begin = 0.25,
                           .dead_end = 0.25}),
              ElementsAre(-3, -1, 1, 3));
}

TEST(Motion, SineIsSlowAtItsEnds) {
  const std::vector<double> positions =
      PositionsOf({.kind = Motion::Kind::kSine, .slices = 10, .travel_mm = 20});
  for (size_t s = 0; s < 10; ++s) {
    const double time = (static_cast<double>(s) + 0.5) / 10;
    EXPECT_NEAR(positions[s], -10 * std::cos(std::numbers::pi * time), 1e-7);
  }
  const std::vector<double> down =
      PositionsOf({.kind = Motion::Kind::kSine, .slices = 10, .travel_mm = 20, .down = true});
  for (size_t s = 0; s < 10; ++s) EXPECT_NEAR(down[s], positions[9 - s], 1e-7);
}

}  // namespace
}  // namespace voxeld::display
