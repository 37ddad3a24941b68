#include "tools/voxelctl/init/init.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "display/drivers/registry.h"
#include "display/profiles/profile.h"
#include "display/sync/fake_clock.h"
#include "tests/tools/voxelctl/temp_folder.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::HasSubstr;

class InitTest : public testing::Test {
 protected:
  absl::Status Answer(const std::string& answers) {
    std::istringstream in(answers);
    std::ostringstream out, err;
    Console console(out, err, false, false);
    const absl::Status status = Init({.file = file_}, in, console);
    said_ = err.str();
    return status;
  }
  // Returns where the display's lights are, by pixel.
  display::Lattice Lattice() const {
    const auto profile = display::ReadProfile(file_);
    EXPECT_TRUE(profile.ok()) << profile.status();
    sync::FakeClock clock;
    const auto display = display::CreateDisplay({"d", profile->driver, profile->options}, clock);
    EXPECT_TRUE(display.ok()) << display.status();
    return std::get<display::Lattice>((*display)->info().geometry.shape);
  }
  const TempFolder folder_;
  const std::string file_ = folder_.Path("cube.toml");
  std::string said_;
};

TEST_F(InitTest, EnterAlwaysIsACubeOnABoard) {
  ASSERT_TRUE(Answer(std::string(12, '\n')).ok()) << said_;
  EXPECT_EQ(ReadAll(file_),
            "title = \"An LED lattice\"\ndriver = \"fadecandy\"\nboards = 1\ncube = \"8x8x8\"\n"
            "pitch_mm = 25\norder = \"xyz\"\nserpentine = \"none\"\nper_strip = 64\n");
  EXPECT_THAT(said_, HasSubstr("voxeld --display lattice=fadecandy,profile="));
}

// 3 wide, 2 deep, 4 high; the first light is at the back, top, right; strands hang down, and the
// next one is to the left.
TEST_F(InitTest, WordsAreAPlaceForEveryLight) {
  ASSERT_TRUE(
      Answer(
          "ddp\n10.0.0.5\ngrb\n3\n2\n4\n10\nback-top-right\nup-down\nleft-right\nzig-zag\nnone\n")
          .ok())
      << said_;
  const display::Lattice lattice = Lattice();
  ASSERT_EQ(lattice.points_mm.size(), 24u);
  const auto at = [&](size_t n) { return *lattice.points_mm[n]; };
  EXPECT_EQ(at(0), (display::Vec3{10, 5, 15}));   // right, back, top
  EXPECT_EQ(at(3), (display::Vec3{10, 5, -15}));  // down
  EXPECT_EQ(at(4), (display::Vec3{0, 5, -15}));   // the next strand goes up again
  EXPECT_EQ(at(7), (display::Vec3{0, 5, 15}));
  EXPECT_EQ(at(8), (display::Vec3{-10, 5, 15}));
  EXPECT_EQ(at(12), (display::Vec3{10, -5, 15}));  // the layer in front of it begins like the first
}

TEST_F(InitTest, AContinuousChainNeverJumps) {
  ASSERT_TRUE(Answer("artnet\n10.0.0.5\n0\nrgb\n3\n2\n4\n10\nfront-bottom-left\nleft-right\nup-"
                     "down\ncont\nnone\n")
                  .ok())
      << said_;
  const display::Lattice lattice = Lattice();
  for (size_t n = 1; n < 24; ++n) {
    const display::Vec3 a = *lattice.points_mm[n - 1], b = *lattice.points_mm[n];
    EXPECT_NEAR(std::abs(a.x - b.x) + std::abs(a.y - b.y) + std::abs(a.z - b.z), 10, 1e-9) << n;
  }
}

TEST_F(InitTest, WhatWillNotDoIsAskedAgain) {
  ASSERT_TRUE(Answer("wifi\nd\nwled.local\n10.0.0.5\ngrb\n0\n4\n4\n4\n\nfront-bottom\nfront-bottom-"
                     "left\n\n\n\nnone\n")
                  .ok())
      << said_;
  EXPECT_THAT(said_, HasSubstr("wifi will not do: one of fadecandy, ddp, e131, artnet, opc"));
  EXPECT_THAT(said_, HasSubstr("wled.local will not do: 192.168.1.20"));
  EXPECT_THAT(said_, HasSubstr("0 will not do: a whole number from 1 to 16384"));
  EXPECT_THAT(said_, HasSubstr("front-bottom will not do: one of front-bottom-left"));
}

TEST_F(InitTest, WritesNothingHalfAndOverNothing) {
  EXPECT_EQ(Answer("ddp\n10.0.0.5\n").code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_FALSE(std::filesystem::exists(file_));
  folder_.Write("cube.toml", "mine");
  EXPECT_EQ(Answer(std::string(12, '\n')).code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(ReadAll(file_), "mine");
}

TEST_F(InitTest, SaysIfNoDisplayComesOfIt) {
  EXPECT_THAT(std::string(Answer("fadecandy\n1\n16\n16\n16\n" + std::string(7, '\n')).message()),
              HasSubstr("no display can be made of it"));
}

}  // namespace
}  // namespace voxeld::voxelctl
