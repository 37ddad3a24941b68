// Tests commands that make pictures and files of what a display shows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/tools/voxelctl/commands_fixture.h"

namespace voxeld::voxelctl {
namespace {

using nlohmann::json;
using testing::HasSubstr;

TEST_F(CommandsTest, ATurntableIsOfOneVolume) {
  const std::string path = folder_.Path("a.gif");
  const json told = RunJson({"render", path, "--frames", "5", "--size", "96x80"});
  EXPECT_EQ(told["frames"], 5);
  EXPECT_EQ(told["display"], "fake");
  EXPECT_EQ(told["lit_pixels"], 256);
  EXPECT_EQ(told["up_to_date"], true);
  EXPECT_EQ(told["bytes"], std::filesystem::file_size(path));
  EXPECT_EQ(ReadAll(path).substr(0, 6), "GIF89a");
  EXPECT_EQ(server_.log().captures.size(), 1u);
  EXPECT_EQ(server_.log().captures[0].at_least_snapshot(), 4u);
}

TEST_F(CommandsTest, LiveTurntablesCaptureEachPicture) {
  const Result result = RunTool({"render", folder_.Path("##.png"), "--frames", "4", "--fps", "240",
                                 "--size", "64x64", "--live"});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("4 pictures of 64x64"));
  EXPECT_EQ(server_.log().captures.size(), 4u);
  std::string first;
  for (const char* name : {"01.png", "02.png", "03.png", "04.png"}) {
    const std::string bytes = ReadAll(folder_.Path(name));
    EXPECT_EQ(bytes.substr(1, 3), "PNG") << name;
    EXPECT_NE(bytes, first) << "it turns";
    first = bytes;
  }
}

TEST_F(CommandsTest, OnePngIsOnePicture) {
  const json told = RunJson({"render", folder_.Path("a.png"), "--azimuth", "90"});
  EXPECT_EQ(told["frames"], 1);
  EXPECT_EQ(told["width"], 1200);
  EXPECT_EQ(ReadAll(folder_.Path("a.png")).substr(1, 3), "PNG");
}

TEST_F(CommandsTest, WhatIsInterruptedLeavesNoFile) {
  interrupt_.Request();
  const Result result = RunTool({"render", folder_.Path("a.gif"), "--size", "64x64"});
  EXPECT_EQ(result.code, kExitInterrupted);
  EXPECT_FALSE(std::filesystem::exists(folder_.Path("a.gif")));
}

TEST_F(CommandsTest, WhatCannotBeWrittenIsToldBeforeTheDisplayIsAsked) {
  const Result result = RunTool({"render", folder_.Path("none/a.gif")});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.err, HasSubstr("none/a.gif: cannot be written"));
  EXPECT_TRUE(server_.log().captures.empty());
}

TEST_F(CommandsTest, ExportsAreOfWhatIsShown) {
  EXPECT_EQ(RunJson({"export", folder_.Path("a.ply")})["items"], 256);
  EXPECT_THAT(ReadAll(folder_.Path("a.ply")), HasSubstr("element vertex 256\n"));
  EXPECT_EQ(RunJson({"export", folder_.Path("a.npz")})["lit_pixels"], 256);
  EXPECT_EQ(ReadAll(folder_.Path("a.npz")).substr(0, 2), "PK");
  const Result result = RunTool({"export", folder_.Path("a.VOX")});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("256 voxels in 1 model"));
  EXPECT_EQ(RunTool({"play", folder_.Path("a.VOX")}).code, 0);
}

}  // namespace
}  // namespace voxeld::voxelctl
