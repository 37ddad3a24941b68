#include "tools/voxelctl/profile/profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "tests/tools/voxelctl/temp_folder.h"

namespace voxeld::voxelctl {
namespace {

using ::testing::HasSubstr;

struct Result {
  absl::Status status;
  std::string out, err;
};

Result Show(const ProfileOptions& options, bool json = false) {
  std::ostringstream out, err;
  Console console(out, err, json, false);
  Result result;
  result.status = ShowProfile(options, console);
  result.out = out.str();
  result.err = err.str();
  return result;
}

TEST(Profile, SaysWhatADisplayComesTo) {
  const TempFolder folder;
  const std::string path = folder.Write(
      "cube.toml", "title = \"a small cube\"\nsize = \"4x3x2\"\nstrokes = \"both\"\nrate = 10\n");
  const Result result = Show({.profile = path});
  ASSERT_TRUE(result.status.ok()) << result.status;
  EXPECT_THAT(result.out, HasSubstr("a small cube\n  planar stack: 4 slices of 4x3 pixels"));
  EXPECT_THAT(result.out, HasSubstr("4x3x2 voxels of 1x1x1 mm"));
  EXPECT_THAT(result.out, HasSubstr("100.0 % of them reached; a voxel is lit 2 to 2 times"));
  const auto json = nlohmann::json::parse(Show({.profile = path}, true).out);
  EXPECT_EQ(json["slices"], 4);
  EXPECT_EQ(json["reachable_share"], 1.0);
  EXPECT_EQ(json["lit_per_volume"]["median"], 2);
  EXPECT_EQ(json["volume_bytes"], 4 * 3 * 3 * 4);
}

TEST(Profile, TakesWhatIsTheDaemonsOrTheDriversToo) {
  const TempFolder folder;
  EXPECT_EQ(Show({.profile = folder.Write(
                      "a.toml", "view = \"voxels\"\nspeed = \"high\"\nsize = \"4x4x4\"\n")})
                .status,
            absl::OkStatus());
  EXPECT_EQ(Show({.profile = folder.Write(
                      "b.toml", "driver = \"voxlink\"\nvendor = \"1209\"\nsize = \"4x4x4\"\n")})
                .status,
            absl::OkStatus());
}

TEST(Profile, OfAGridThatIsTooLargeCountsNothing) {
  const TempFolder folder;
  const std::string path = folder.Write(
      "far.toml",
      "geometry = \"lattice\"\npoints_mm = [-2000, -2000, -2000, 2000, 2000, 2000]\nwidth = 2\n");
  const auto json = nlohmann::json::parse(Show({.profile = path}, true).out);
  EXPECT_FALSE(json.contains("reachable_share"));
  EXPECT_EQ(json["voxels"][0], 4001);
}

// A panel on the axis: voxels near it are lit more often than distant ones.
TEST(Profile, CountsHowOftenVoxelsAreLit) {
  const TempFolder folder;
  const std::string path =
      folder.Write("rotor.toml", "geometry = \"rotor\"\nsize = \"16x2\"\nslices = 60\n");
  const auto json = nlohmann::json::parse(Show({.profile = path}, true).out);
  EXPECT_EQ(json["shape"], "rotor");
  EXPECT_GT(json["lit_per_volume"]["most"], json["lit_per_volume"]["median"]);
  EXPECT_NEAR(json["reachable_share"].get<double>(), 0.785, 0.05);
}

TEST(Profile, WhatIsWrongIsSaid) {
  const TempFolder folder;
  const absl::Status none = Show({.profile = folder.Path("none.toml")}).status;
  EXPECT_EQ(none.code(), absl::StatusCode::kNotFound);
  const absl::Status wrong =
      Show({.profile = folder.Write("a.toml", "geometry = \"rotor\"\ntilt = 90\n")}).status;
  EXPECT_EQ(wrong.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(wrong.message()), HasSubstr("panels[0].tilt_deg is 90"));
  const absl::Status unknown =
      Show({.profile = folder.Write("b.toml", "geometri = \"rotor\"\n")}).status;
  EXPECT_THAT(std::string(unknown.message()), HasSubstr("unknown option geometri"));
  const absl::Status other =
      Show({.profile = folder.Write("c.toml", "driver = \"fadecandy\"\n")}).status;
  EXPECT_THAT(
      std::string(other.message()),
      HasSubstr("To check it, run: voxeld --check-config --display NAME=fadecandy,profile="));
}

}  // namespace
}  // namespace voxeld::voxelctl
