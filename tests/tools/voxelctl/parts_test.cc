// Tests commands whose part a build leaves out.
#include <gmock/gmock.h>

#include <algorithm>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "tests/tools/voxelctl/commands_fixture.h"

namespace voxeld::voxelctl {
namespace {

using testing::HasSubstr;

class PartsTest : public CommandsTest {};

TEST_F(PartsTest, CommandNotBuiltReportsHowToAddItInOneLine) {
  for (const char* line :
       {"VOXELD_RECORDING record a.mcap", "VOXELD_RECORDING replay a.mcap",
        "VOXELD_RECORDING playlist a.toml", "VOXELD_LIGHTS input opc",
        "VOXELD_LIGHTS pipe --size 2x2x2", "VOXELD_MARKERS markers ws://127.0.0.1:8765"}) {
    const std::vector<std::string> words = absl::StrSplit(line, ' ');
    // The answer needs no server.
    std::vector<std::string> arguments = {"--server", "127.0.0.1:1"};
    arguments.insert(arguments.end(), words.begin() + 1, words.end());
    const Result result = RunAnywhere(arguments);
    EXPECT_EQ(result.code, 1) << line;
    EXPECT_THAT(result.err, HasSubstr("this build ")) << line;
    EXPECT_THAT(result.err,
                HasSubstr(absl::StrCat(", run in the source tree: cmake --preset demo -D", words[0],
                                       "=ON && cmake --build --preset demo -j $(tools/jobs)")));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.out, "") << line;
  }
}

TEST_F(PartsTest, HelpListsEveryCommandInEveryBuild) {
  const Result help = RunAnywhere({"--help"});
  EXPECT_EQ(help.code, 0);
  for (const char* command : {"record", "replay", "playlist", "input", "pipe", "markers", "play"})
    EXPECT_THAT(help.out, HasSubstr(command));
}

}  // namespace
}  // namespace voxeld::voxelctl
