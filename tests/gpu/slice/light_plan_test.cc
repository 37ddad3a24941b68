#include "gpu/slice/light_plan.h"

#include <gtest/gtest.h>

#include "display/geometry/footprint.h"

namespace voxeld::gpu {
namespace {

TEST(LightPlanner, KeepsAPlanUntilAnotherIsAskedFor) {
  display::Rotor rotor;
  rotor.slices_per_turn = 60;
  rotor.width_px = 24;
  rotor.height_px = 8;
  rotor.panels.resize(1);
  display::Geometry geometry{rotor, {}};
  geometry.grid = display::DefaultGrid(geometry);
  const display::FootprintTable table = display::BuildFootprints(geometry, display::Sampling::kMax);
  const display::FrameLayout layout{.slices = 60, .width = 24, .height = 8};
  display::Tone tone;
  tone.SetCurve(display::Tone::Linear());
  tone.density = display::Density::kEven;

  LightPlanner planner;
  const std::shared_ptr<const LightPlan> first = planner.Of(table, geometry, layout, tone);
  ASSERT_FALSE(first->factors.empty());
  EXPECT_EQ(planner.Of(table, geometry, layout, tone), first);

  // Whatever else than the view differs is another plan, and as good as one made afresh.
  display::Tone dim = tone;
  dim.lut[1][255] = 1000;
  const std::shared_ptr<const LightPlan> second = planner.Of(table, geometry, layout, dim);
  const LightPlan fresh = LightPlan::Of(table, geometry.grid, layout, dim);
  EXPECT_EQ(second->factors, fresh.factors);
  EXPECT_EQ(second->curves, fresh.curves);
  EXPECT_NE(second->curves, first->curves);

  display::FrameLayout bits = layout;
  bits.format = display::PixelFormat::kBitPlanes;
  EXPECT_NE(planner.Of(table, geometry, bits, dim)->factors, second->factors);

  display::Geometry shifted = geometry;
  std::get<display::Rotor>(shifted.shape).panels[0].eccentricity_mm = 3;
  const display::FootprintTable other = display::BuildFootprints(shifted, display::Sampling::kMax);
  EXPECT_EQ(planner.Of(other, shifted, bits, dim)->factors,
            LightPlan::Of(other, geometry.grid, bits, dim).factors);
}

}  // namespace
}  // namespace voxeld::gpu
