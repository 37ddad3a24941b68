#include "tools/ros/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace voxeld::ros1 {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

ParsedCommandLine Parse(const std::vector<std::string>& arguments, const std::string& uri = "") {
  return ParseCommandLine(arguments, [uri](const char* name) {
    return std::string(name) == "ROS_MASTER_URI" ? uri : "";
  });
}

TEST(Options, AreReadInAnyOrderWithWhatRoslaunchAdds) {
  const ParsedCommandLine parsed =
      Parse({"--topic", "/a", "__name:=light", "--server", "unix:/s", "--json", "--topic", "b",
             "--layer", "robot", "__log:=/tmp/x.log"});
  ASSERT_TRUE(parsed.options) << parsed.err;
  EXPECT_THAT(parsed.options->ros.topics, ElementsAre("/a", "b"));
  EXPECT_THAT(parsed.options->ros.remappings,
              ElementsAre(Pair("__log", "/tmp/x.log"), Pair("__name", "light")));
  EXPECT_EQ(parsed.options->server, "unix:/s");
  EXPECT_EQ(parsed.options->layer, "robot");
  EXPECT_TRUE(parsed.options->json);
}

TEST(Options, TheMasterIsTheNearestThatIsSaid) {
  const auto master = [](const std::vector<std::string>& arguments, const std::string& uri) {
    const ParsedCommandLine parsed = Parse(arguments, uri);
    return parsed.options ? parsed.options->ros.master : parsed.err;
  };
  EXPECT_EQ(master({}, ""), "http://localhost:11311");
  EXPECT_EQ(master({}, "http://env:1"), "http://env:1");
  EXPECT_EQ(master({"__master:=http://remapped:2"}, "http://env:1"), "http://remapped:2");
  EXPECT_EQ(master({"--master", "http://said:3", "__master:=http://remapped:2"}, "http://env:1"),
            "http://said:3");
}

TEST(Options, WrongOnesAreUsageErrors) {
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"--layer", ""}, {"--topic", ""}, {"--topic"}, {"/a"}, {"--none"}}) {
    const ParsedCommandLine parsed = Parse(wrong);
    EXPECT_FALSE(parsed.options);
    EXPECT_EQ(parsed.exit_code, kExitUsage);
    EXPECT_THAT(parsed.err, HasSubstr("voxeld-ros: "));
  }
}

TEST(Options, WrongOnesAreToldWithWhatWasMeant) {
  EXPECT_THAT(Parse({"--topc", "/a"}).err,
              HasSubstr("--topc is no option here; did you mean --topic?"));
  EXPECT_THAT(Parse({"/a"}).err, HasSubstr("\"/a\" is one argument too many"));
  EXPECT_THAT(Parse({"--topic"}).err, HasSubstr("--topic wants a value, NAME: Only this one"));
}

TEST(Options, HelpAndVersionArePrinted) {
  EXPECT_THAT(Parse({"--help"}).out, HasSubstr("--topic"));
  EXPECT_THAT(Parse({"--version"}).out, HasSubstr("voxeld-ros "));
  EXPECT_EQ(Parse({"--help"}).exit_code, 0);
}

}  // namespace
}  // namespace voxeld::ros1
