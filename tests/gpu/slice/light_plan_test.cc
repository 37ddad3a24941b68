#include "gpu/slice/light_plan.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>

#include "display/geometry/footprint.h"

namespace voxeld::gpu {
namespace {

class LightPlannerTest : public testing::Test {
 protected:
  LightPlannerTest() {
    display::Rotor rotor;
    rotor.slices_per_turn = 60;
    rotor.width_px = 24;
    rotor.height_px = 8;
    rotor.panels.resize(1);
    geometry_.shape = rotor;
    geometry_.grid = display::DefaultGrid(geometry_);
    tone_.SetCurve(display::Tone::Linear());
    tone_.density = display::Density::kEven;
    layout_ = {.slices = 60, .width = 24, .height = 8};
  }
  // Returns the planner's plan, which must equal a newly made one.
  LightPlan Plan() {
    const display::FootprintTable table = display::BuildFootprints(geometry_, tone_.sampling);
    const std::shared_ptr<const LightPlan> plan = planner_.Of(table, geometry_, layout_, tone_);
    const LightPlan fresh = LightPlan::Of(table, geometry_.grid, layout_, tone_);
    EXPECT_EQ(plan->factors, fresh.factors);
    EXPECT_EQ(plan->curves, fresh.curves);
    EXPECT_EQ(plan->noise, fresh.noise);
    return *plan;
  }

  display::Geometry geometry_;
  display::FrameLayout layout_;
  display::Tone tone_;
  LightPlanner planner_;
};

TEST_F(LightPlannerTest, PlansAreThoseOfTheirTargets) {
  const LightPlan first = Plan();
  ASSERT_FALSE(first.factors.empty());
  Plan();
  layout_.format = display::PixelFormat::kBitPlanes;
  EXPECT_NE(Plan().factors, first.factors);
  tone_.sampling = display::Sampling::kWeighted;
  Plan();
  std::get<display::Rotor>(geometry_.shape).panels[0].eccentricity_mm = 3;
  Plan();
  tone_.density = display::Density::kFull;
  EXPECT_TRUE(Plan().factors.empty());
  tone_.dither = display::Dither::kBlueNoise;
  EXPECT_FALSE(Plan().noise.empty());
}

// However far a display is dimmed, its rows keep their proportions: crowded ones do not become
// brighter again.
TEST_F(LightPlannerTest, DimmedIsAsEven) {
  layout_.format = display::PixelFormat::kRgb332;
  const LightPlan full = Plan();
  for (const int share : {2, 7, 40}) {
    display::Tone::Curve curve = display::Tone::Linear();
    for (uint16_t& light : curve) light = static_cast<uint16_t>(light / share);
    tone_.SetCurve(curve);
    const LightPlan dimmed = Plan();
    EXPECT_NE(dimmed.curves, full.curves);
    size_t differ = 0;
    for (size_t row = 0; row < full.factors.size(); ++row) {
      differ += std::abs(full.factors[row] - dimmed.factors[row]) > 66 ? 1 : 0;  // a thousandth
    }
    EXPECT_EQ(differ, 0u) << "1/" << share;
  }
}

}  // namespace
}  // namespace voxeld::gpu
