// Tests calibration with prepared answers in place of a person; the display is the simulated one,
// opened and shown on for each of them.
#include "tools/voxelctl/calibrate/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

#include "display/drivers/registry.h"
#include "display/geometry/footprint.h"
#include "display/profiles/profile.h"
#include "display/sync/fake_clock.h"
#include "tests/tools/voxelctl/temp_folder.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::HasSubstr;

class CalibrateTest : public testing::Test {
 protected:
  absl::Status Answer(const std::string& display, const std::string& answers) {
    std::istringstream in(answers);
    std::ostringstream out, err;
    Console console(out, err, false, false);
    const absl::Status status = Calibrate({.display = display, .file = file_}, in, console);
    said_ = err.str();
    return status;
  }
  static display::Geometry Of(const std::map<std::string, std::string>& options) {
    sync::FakeClock clock;
    const auto display = display::CreateDisplay({"d", "simulated", options}, clock);
    EXPECT_TRUE(display.ok()) << display.status();
    return (*display)->info().geometry;
  }
  display::Geometry Written() const {
    const auto profile = display::ReadProfile(file_);
    EXPECT_TRUE(profile.ok()) << profile.status();
    return Of(profile->options);
  }
  const TempFolder folder_;
  const std::string file_ = folder_.Path("measured.toml");
  std::string said_;
};

// Two panels; in truth it is mirrored and turns clockwise, and the second panel is 0.9 mm farther
// out.
TEST_F(CalibrateTest, ARotorsOrientationAndEccentricity) {
  const std::string thought =
      "r=simulated,geometry=rotor,size=16x8,slices=24,pitch_mm=3,eccentricity=1;0,rate=60";
  ASSERT_TRUE(Answer(thought, "mirror-u\ndirection\nok\n2 +1.2\n3 1\n2 -0.3\nok\n").ok()) << said_;
  EXPECT_EQ(Written(), Of({{"geometry", "rotor"},
                           {"size", "16x8"},
                           {"slices", "24"},
                           {"pitch_mm", "3"},
                           {"eccentricity", "1;0.3"},
                           {"mirror_u", "true"},
                           {"clockwise", "true"},
                           {"rate", "60"}}));
  EXPECT_THAT(said_, HasSubstr("red goes to the right"));
  EXPECT_THAT(said_, HasSubstr("3 1 will not do: ok, or a panel from 1 to 2"));
  EXPECT_THAT(said_, HasSubstr("voxeld --display r=simulated,profile="));
}

// A quarter turn moves what pointed along +x to +y: tested by the pixels' places, not by the
// option's name.
TEST_F(CalibrateTest, AQuarterOfATurnIsOne) {
  const std::string thought =
      "simulated,geometry=rotor,size=8x4,slices=16,rate=60,eccentricity=0.5";
  ASSERT_TRUE(Answer(thought, "quarter\nok\nok\n").ok()) << said_;
  const display::Geometry before =
      Of({{"geometry", "rotor"}, {"size", "8x4"}, {"slices", "16"}, {"eccentricity", "0.5"}});
  const display::Geometry after = Written();
  for (int32_t u = 0; u < 8; ++u) {
    const display::Vec3 a = display::PixelPosition(before, 3, u, 1);
    const display::Vec3 b = display::PixelPosition(after, 3, u, 1);
    EXPECT_NEAR(b.x, -a.y, 1e-9);
    EXPECT_NEAR(b.y, a.x, 1e-9);
    EXPECT_NEAR(b.z, a.z, 1e-9);
  }
}

TEST_F(CalibrateTest, AStacksMirrorsOrderAndKeystone) {
  const std::string thought = "simulated,size=10x6x4,mirror_v=true,rate=60";
  // Corners: the first question's default is -5, -3; enter keeps it.
  ASSERT_TRUE(Answer(thought, "reverse\nmirror-v\nok\nmeasure\n-4.5\n\n4.5\n\n\n\n\n\nok\n").ok())
      << said_;
  EXPECT_EQ(Written(), Of({{"size", "10x6x4"},
                           {"mirror_v", "false"},
                           {"strokes", "down"},
                           {"keystone_mm", "-4.5;-3;4.5;-3;5;3;-5;3"}}));
  EXPECT_THAT(said_,
              HasSubstr("The left front corner: millimetres to the right of the middle? [-5]"));
}

TEST_F(CalibrateTest, AProfilesOptionsAndTitleComeAlong) {
  const std::string profile = folder_.Path("mine.toml");
  std::ofstream(profile) << "title = \"Uncle's \\\"big\\\" one\"\nsize = \"8x8x4\"\nrate = "
                            "60\nformat = \"bitplanes\"\n";
  ASSERT_TRUE(Answer("simulated,profile=" + profile, "\n\n").ok()) << said_;
  const auto written = display::ReadProfile(file_);
  ASSERT_TRUE(written.ok()) << written.status();
  const auto read = display::ReadProfile(profile);
  EXPECT_EQ(written->title, read->title);
  EXPECT_EQ(written->options, read->options);
  EXPECT_THAT(said_, HasSubstr("nothing had to be changed"));
}

TEST_F(CalibrateTest, WhatCannotBeIsSaidAndNothingIsWritten) {
  EXPECT_EQ(Answer("nodriver", "").code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(Answer("simulated,size=8x8x4,profile=nowhere/x.toml", "").code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(Answer("simulated,size=8x8x4,rate=60", "ok\n").code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_FALSE(std::filesystem::exists(file_));
  // A keystone that no picture can have: it stays unchanged, and the question is asked again.
  ASSERT_TRUE(
      Answer("simulated,size=8x8x4,rate=60", "ok\nmeasure\n0\n0\n0\n0\n0\n0\n0\n0\nok\n").ok())
      << said_;
  EXPECT_THAT(said_, HasSubstr("that will not do: "));
  EXPECT_FALSE(Written().correction.has_value());
  EXPECT_EQ(Answer("simulated,size=8x8x4", "").code(), absl::StatusCode::kAlreadyExists);
}

}  // namespace
}  // namespace voxeld::voxelctl
