// Tests depth anti-aliasing: between two slices, light is at its correct depth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "display/drivers/options.h"
#include "display/geometry/footprint.h"
#include "display/profiles/profile.h"
#include "gpu/slice/weight.h"

namespace voxeld::gpu {
namespace {

constexpr double kMostError = 0.1;  // the promised error, relative to the distance of slices

// The DepthCube's 20 planes, with fewer pixels.
display::Geometry DepthCube() {
  auto profile = display::ReadProfile(std::string(VOXELD_PROFILES_DIR) + "/depthcube.toml");
  EXPECT_TRUE(profile.ok()) << profile.status();
  profile->options["size"] = "64x48x20";
  const display::DisplayOptions options{"display", "simulated", profile->options};
  display::OptionReader reader(options);
  const auto info = display::ReadDisplayInfo(options, reader);
  EXPECT_TRUE(info.ok()) << info.status();
  EXPECT_EQ(info->tone.sampling, display::Sampling::kWeighted);
  return info->geometry;
}

// A plane tilted relative to the slices, one voxel thick: in each column, the voxel that it crosses
// is white. For each pixel, the centre of the light of all slices is compared with the position of
// the plane.
TEST(DepthAntiAliasing, ATiltedPlaneStandsWhereItIs) {
  const display::Geometry geometry = DepthCube();
  const display::VoxelGrid& grid = geometry.grid;
  const auto& stack = std::get<display::PlanarStack>(geometry.shape);
  const double first = stack.positions_mm.front(), last = stack.positions_mm.back();
  const double spacing = std::abs(stack.positions_mm[1] - first);
  const display::FootprintTable table =
      display::BuildFootprints(geometry, display::Sampling::kWeighted);
  const auto depth_at = [&](int32_t u, int32_t v) {
    return first + (last - first) * (0.02 + 0.9 * u / 64 + 0.06 * v / 48);
  };
  double worst = 0, sum = 0, nearest_worst = 0;
  int64_t count = 0;
  for (int32_t v = 0; v < table.height; ++v) {
    for (int32_t u = 0; u < table.width; ++u) {
      const double depth = depth_at(u, v);
      const auto lit =
          static_cast<int32_t>(std::floor((depth - grid.origin_mm.y) / grid.pitch_mm.y));
      double light = 0, moment = 0;
      for (int32_t s = 0; s < table.slices; ++s) {
        uint32_t rgb = 0;
        for (const display::FootprintEntry& o : table.Outer(s, u)) {
          for (const display::FootprintEntry& i : table.Inner(s, v)) {
            const bool here = o.x + i.x == u && o.z + i.z == v && o.y + i.y == lit;
            if (here) rgb = RaiseWeighted(rgb, FootprintWeight(o.weight, i.weight), 0xFFFFFF);
          }
        }
        light += rgb & 0xFF;
        moment += (rgb & 0xFF) * stack.positions_mm[static_cast<size_t>(s)];
      }
      ASSERT_GT(light, 0) << u << ", " << v;
      const double error = std::abs(moment / light - depth) / spacing;
      worst = std::max(worst, error);
      sum += error;
      const double in_slices = (depth - first) / (last - first) * (table.slices - 1);
      nearest_worst = std::max(nearest_worst, std::abs(in_slices - std::round(in_slices)));
      ++count;
    }
  }
  std::printf(
      "position error of a tilted plane: mean %.3f, most %.3f of a slice's distance; by the "
      "nearest slice alone %.3f\n",
      sum / static_cast<double>(count), worst, nearest_worst);
  EXPECT_LE(worst, kMostError);
  EXPECT_GT(nearest_worst, 0.45);
}

}  // namespace
}  // namespace voxeld::gpu
