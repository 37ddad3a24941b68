#include "daemon/config/display_view.h"

#include <gmock/gmock.h>

namespace voxeld::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

absl::StatusOr<DisplayOptions> Split(const char* text) {
  return SplitDisplayOptions(*ParseDisplayOption(text));
}

TEST(DisplayView, IsFitUnlessItSaysOtherwise) {
  const auto split = Split("sim=simulated,geometry=rotor");
  ASSERT_TRUE(split.ok()) << split.status();
  EXPECT_EQ(split->setup.view.mode, ViewOptions::Mode::kFit);
  EXPECT_FALSE(split->setup.view.box.has_value());
  EXPECT_THAT(split->driver, ElementsAre(Pair("geometry", "rotor")));
}

TEST(DisplayView, IsTakenOutOfTheDriversOptions) {
  const auto split = Split("sim=simulated,view=millimetres,size=8x8");
  ASSERT_TRUE(split.ok()) << split.status();
  EXPECT_EQ(split->setup.view.mode, ViewOptions::Mode::kMillimetres);
  EXPECT_THAT(split->driver, ElementsAre(Pair("size", "8x8")));
  EXPECT_EQ(Split("sim=simulated,view=voxels")->setup.view.mode, ViewOptions::Mode::kVoxels);
}

TEST(DisplayView, ABoxIsSixNumbers) {
  const auto split = Split("sim=simulated,view_box=-1;-2;-3;1;2.5;3e1");
  ASSERT_TRUE(split.ok()) << split.status();
  EXPECT_EQ(split->setup.view.box->first, (display::Vec3{-1, -2, -3}));
  EXPECT_EQ(split->setup.view.box->second, (display::Vec3{1, 2.5, 30}));
  for (const char* wrong : {"", "1;2;3", "1;2;3;4;5;6;7", "1;2;3;4;5;six", "1,2,3,4,5,6"}) {
    DisplayConfig config;
    config.options["view_box"] = wrong;
    EXPECT_THAT(SplitDisplayOptions(config).status().message(), HasSubstr("x0;y0;z0;x1;y1;z1"))
        << wrong;
  }
}

TEST(DisplayView, AnUnknownOneIsAnsweredWithWhatIsMeant) {
  EXPECT_THAT(Split("sim=simulated,view=voxel").status().message(),
              HasSubstr("view is \"voxel\"; did you mean voxels?"));
}

TEST(DisplayView, ALockAndAPowerLimitAreTheDaemonsOwn) {
  const auto split = Split("sim=simulated,genlock=wall,power_limit=12.5,power_full=40,size=8x8");
  ASSERT_TRUE(split.ok()) << split.status();
  EXPECT_EQ(split->setup.genlock, "wall");
  EXPECT_EQ(split->setup.power_limit_w, 12.5);
  EXPECT_EQ(split->setup.power_full_w, 40);
  EXPECT_THAT(split->driver, ElementsAre(Pair("size", "8x8")));
  EXPECT_EQ(Split("sim=simulated")->setup.power_limit_w, 0);
  for (const char* key : {"power_limit", "power_full"}) {
    for (const char* wrong : {"", "-1", "nan", "inf", "1e7", "40W"}) {
      DisplayConfig config;
      config.options[key] = wrong;
      EXPECT_THAT(SplitDisplayOptions(config).status().message(),
                  HasSubstr(std::string(key) + " is \"" + wrong + "\"; give watts"))
          << wrong;
    }
  }
  DisplayConfig unnamed;
  unnamed.options["genlock"] = "";
  EXPECT_THAT(SplitDisplayOptions(unnamed).status().message(), HasSubstr("the name of a group"));
}

TEST(DisplayView, GpusAreNumbersEachOnce) {
  EXPECT_THAT(Split("sim=simulated")->gpus, ElementsAre());
  const auto split = Split("sim=simulated,gpus=3;0;1,size=8x8");
  ASSERT_TRUE(split.ok()) << split.status();
  EXPECT_THAT(split->gpus, ElementsAre(3, 0, 1));
  EXPECT_THAT(split->driver, ElementsAre(Pair("size", "8x8")));
  for (const char* wrong : {"", "0;", "0;x", "-1", "1024", "0,1", "0;1.5"}) {
    DisplayConfig config;
    config.options["gpus"] = wrong;
    EXPECT_THAT(SplitDisplayOptions(config).status().message(),
                HasSubstr("give numbers of GPUs from 0 to 1023"))
        << wrong;
  }
  EXPECT_THAT(Split("sim=simulated,gpus=1;2;1").status().message(),
              HasSubstr("gpus is \"1;2;1\", which has 1 twice"));
}

TEST(DisplayView, GpusMustSuitEngineAndDisplay) {
  using gpu::EngineKind;
  EXPECT_TRUE(CheckGpus({}, EngineKind::kCpu, 1).ok());
  EXPECT_TRUE(CheckGpus({0, 1}, EngineKind::kAuto, 2).ok());
  EXPECT_THAT(CheckGpus({0}, EngineKind::kCpu, 8).message(), HasSubstr("the engine is cpu"));
  EXPECT_THAT(CheckGpus({0, 1, 2}, EngineKind::kCuda, 2).message(),
              HasSubstr("gpus names 3 GPUs, and the display has 2 slices"));
}

}  // namespace
}  // namespace voxeld::daemon
