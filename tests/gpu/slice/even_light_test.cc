// For every display profile that is shipped, a solid of one colour is evenly bright, with as much
// light as is possible evenly, and each voxel alone lights a pixel. The measurements are printed:
// docs/results/fidelity.md lists them.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "display/drivers/options.h"
#include "display/profiles/profile.h"
#include "tests/gpu/slice/measured_light.h"

namespace voxeld::gpu {
namespace {

// The promised bounds.
constexpr double kVariationAtFourBits = 0.05, kVariationBelow = 0.1;
constexpr double kLightKept = 0.9;

class EvenLight : public testing::TestWithParam<std::string> {
 protected:
  static DisplayUnderTest Read() {
    const auto profile =
        display::ReadProfile(std::string(VOXELD_PROFILES_DIR) + "/" + GetParam() + ".toml");
    EXPECT_TRUE(profile.ok()) << profile.status();
    display::DisplayOptions options{"display", "simulated", profile->options};
    display::OptionReader reader(options);
    const auto info = display::ReadDisplayInfo(options, reader);
    EXPECT_TRUE(info.ok()) << info.status();
    return {info->geometry, info->layout, info->tone};
  }
};

TEST_P(EvenLight, OfASolid) {
  DisplayUnderTest display = Read();
  const MeasuredLight after = MeasureLight(display);
  display.tone.density = display::Density::kFull;
  const MeasuredLight before = MeasureLight(display);
  ASSERT_GT(after.cubes, 0);
  std::printf(
      "%s: %lld cubes, variation %.1f %% before, %.1f %% after; light kept %.3f of the best\n",
      GetParam().c_str(), static_cast<long long>(after.cubes), 100 * before.variation,
      100 * after.variation, after.mean / before.least);
  const int32_t bits = display.layout.bits_per_channel();
  EXPECT_LE(after.variation, bits >= 4 ? kVariationAtFourBits : kVariationBelow);
  EXPECT_GE(after.mean, kLightKept * before.least);
}

TEST_P(EvenLight, LeavesNoVoxelDark) {
  const DarkVoxels voxels = CountDarkVoxels(Read());
  std::printf("%s: %lld voxels within reach, %lld dark\n", GetParam().c_str(),
              static_cast<long long>(voxels.reachable), static_cast<long long>(voxels.dark));
  EXPECT_GT(voxels.reachable, 0);
  EXPECT_EQ(voxels.dark, 0);
}

INSTANTIATE_TEST_SUITE_P(Profiles, EvenLight,
                         testing::ValuesIn(display::ProfilesIn(VOXELD_PROFILES_DIR)),
                         [](const auto& info) {
                           std::string name = info.param;
                           for (char& c : name) c = c == '-' ? '_' : c;
                           return name;
                         });

}  // namespace
}  // namespace voxeld::gpu
