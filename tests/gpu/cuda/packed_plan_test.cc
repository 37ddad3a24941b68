// Tests which displays are packed while they are drawn, and by which tables.
#include "gpu/cuda/packed_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

#include "gpu/slice/quantize.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {
namespace {

struct Display {
  display::PlanarStack stack;
  display::Geometry geometry;
  display::FrameLayout layout;
  display::Tone tone;

  Display(int32_t width, int32_t height, int32_t slices) {
    stack.width_px = width;
    stack.height_px = height;
    for (int32_t s = 0; s < slices; ++s) stack.positions_mm.push_back(s - (slices - 1) * 0.5);
    layout.slices = slices;
    layout.width = width;
    layout.height = height;
    layout.format = display::PixelFormat::kBitPlanes;
    tone.SetCurve(display::Tone::Linear());
    geometry.shape = stack;
    geometry.grid = display::DefaultGrid(geometry);
  }
  std::optional<PackedPlan> Plan(int32_t begin, int32_t end) const {
    return PackedPlan::Of(display::BuildFootprints(geometry, tone.sampling), geometry.grid, layout,
                          tone, begin, end, 4);
  }
};

TEST(PackedPlan, TakesAStackOfTheGridsOwnResolution) {
  const Display display(40, 24, 8);
  const std::optional<PackedPlan> plan = display.Plan(0, 8);
  ASSERT_TRUE(plan);
  ASSERT_EQ(plan->slice_of_z.size(), 8u);
  for (int32_t z = 0; z < 8; ++z) EXPECT_EQ(plan->slice_of_z[static_cast<size_t>(z)], z);
  // Each pixel's voxel, by the table that every engine uses.
  const display::FootprintTable table =
      display::BuildFootprints(display.geometry, display.tone.sampling);
  for (int32_t v = 0; v < 24; ++v) {
    EXPECT_EQ(table.Inner(0, v)[0].y, plan->y0 + plan->y_step * v) << "row " << v;
  }
}

TEST(PackedPlan, NamesOwnedSlicesByTheirPlaceInThePart) {
  const std::optional<PackedPlan> plan = Display(16, 16, 8).Plan(3, 6);
  ASSERT_TRUE(plan);
  EXPECT_EQ(plan->slice_of_z, (std::vector<int32_t>{-1, -1, -1, 0, 1, 2, -1, -1}));
}

TEST(PackedPlan, GroupsAreOneAfterTheOther) {
  const std::optional<PackedPlan> plan = Display(16, 16, 100).Plan(0, 100);
  ASSERT_TRUE(plan);
  // 7 planes of 16 voxels, the last with 4.
  std::vector<std::array<int32_t, 3>> groups;
  for (const PackedPlan::Group& group : plan->groups) {
    groups.push_back({group.z_end, group.begin, group.end});
  }
  EXPECT_EQ(groups, (std::vector<std::array<int32_t, 3>>{
                        {16, 0, 16}, {48, 16, 48}, {80, 48, 80}, {100, 80, 100}}));
}

TEST(PackedPlan, GroupsOfAPartHaveItsSlicesAlone) {
  const std::optional<PackedPlan> plan = Display(16, 16, 128).Plan(40, 70);
  ASSERT_TRUE(plan);
  int32_t slices = 0, z = 0;
  for (const PackedPlan::Group& group : plan->groups) {
    EXPECT_GT(group.z_end, z);
    z = group.z_end;
    slices += group.end - group.begin;
  }
  EXPECT_EQ(z, 128);
  EXPECT_EQ(slices, 30);
}

TEST(PackedPlan, SlicesFromTheTopDownAreGroupsToo) {
  Display display(16, 16, 64);
  std::reverse(display.stack.positions_mm.begin(), display.stack.positions_mm.end());
  display.geometry.shape = display.stack;
  const std::optional<PackedPlan> plan = display.Plan(0, 64);
  ASSERT_TRUE(plan);
  EXPECT_EQ(plan->slice_of_z[0], 63);
  int32_t z = 0;
  for (const PackedPlan::Group& group : plan->groups) {
    for (; z < group.z_end; ++z) {
      EXPECT_GE(plan->slice_of_z[static_cast<size_t>(z)], group.begin) << z;
      EXPECT_LT(plan->slice_of_z[static_cast<size_t>(z)], group.end) << z;
    }
  }
  EXPECT_EQ(plan->groups.size(), 4u);
  EXPECT_EQ(z, 64);
}

TEST(PackedPlan, LeavesEverythingElseToSlicing) {
  Display weighted(16, 16, 8);
  weighted.tone.sampling = display::Sampling::kWeighted;
  EXPECT_FALSE(weighted.Plan(0, 8));

  Display coarse(16, 16, 8);  // two voxels a pixel
  coarse.geometry.grid.nx *= 2;
  coarse.geometry.grid.pitch_mm.x /= 2;
  EXPECT_FALSE(coarse.Plan(0, 8));

  Display many(16, 16, 8);
  many.layout.sub_frames = 33;
  EXPECT_FALSE(many.Plan(0, 8));

  Display bent(16, 16, 8);
  for (display::Tone::Curve& curve : bent.tone.lut) std::swap(curve[10], curve[200]);
  EXPECT_FALSE(bent.Plan(0, 8));
  bent.layout.format = display::PixelFormat::kRgb332;  // where any tone is possible
  EXPECT_TRUE(bent.Plan(0, 8));
}

TEST(PackedPlan, LeastLevelsAreThoseThatQuantizeToLight) {
  Display display(16, 16, 2);
  display.layout.sub_frames = 3;
  display.tone.dither = display::Dither::kOrdered;
  display::Tone::Curve square;
  for (size_t c = 0; c < 256; ++c) square[c] = static_cast<uint16_t>(c * c);
  display.tone.SetCurve(square);
  const std::optional<PackedPlan> plan = display.Plan(0, 2);
  ASSERT_TRUE(plan);
  ASSERT_EQ(plan->least.size(), 3u * 64);
  for (uint32_t sub = 0; sub < 3; ++sub) {
    for (uint32_t v = 0; v < 8; ++v) {
      for (uint32_t u = 0; u < 8; ++u) {
        const uint32_t least = plan->least[(sub * 8 + v) * 8 + u];
        const uint32_t threshold = Threshold(display.tone.dither, u, v, sub, 3);
        for (uint32_t c = 0; c < 256; ++c) {
          EXPECT_EQ((Interleave(c) & 0x249249) >= least, Quantize(square[c], 2, threshold) == 1)
              << "level " << c << " at " << u << ", " << v << ", sub-frame " << sub;
        }
      }
    }
  }
}

}  // namespace
}  // namespace voxeld::gpu::cuda
