#include "daemon/config/display_config.h"

#include <gmock/gmock.h>

namespace voxeld::daemon {
namespace display_config_test {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

TEST(DisplayOption, NameAndDriver) {
  const auto display = ParseDisplayOption("sim=simulated");
  ASSERT_TRUE(display.ok()) << display.status();
  EXPECT_EQ(display->name, "sim");
  EXPECT_EQ(display->driver, "simulated");
  EXPECT_THAT(display->options, IsEmpty());
}

TEST(DisplayOption, Options) {
  const auto display =
      ParseDisplayOption("r.1=simulated,geometry=rotor,size=128x64,note=a=b,empty=");
  ASSERT_TRUE(display.ok()) << display.status();
  EXPECT_EQ(display->name, "r.1");
  EXPECT_THAT(display->options,
              UnorderedElementsAre(Pair("geometry", "rotor"), Pair("size", "128x64"),
                                   Pair("note", "a=b"), Pair("empty", "")));
}

struct Case {
  const char* text;
  const char* why;
};

class WrongDisplayOption : public ::testing::TestWithParam<Case> {};

TEST_P(WrongDisplayOption, SaysWhatWouldBeRight) {
  const auto display = ParseDisplayOption(GetParam().text);
  ASSERT_TRUE(absl::IsInvalidArgument(display.status()));
  const std::string message(display.status().message());
  EXPECT_THAT(message, HasSubstr(GetParam().why));
  EXPECT_THAT(message, HasSubstr("NAME=DRIVER"));
}

INSTANTIATE_TEST_SUITE_P(
    Text, WrongDisplayOption,
    ::testing::Values(Case{"", "names no driver"}, Case{"sim", "names no driver"},
                      Case{"sim=", "names no driver"}, Case{"=simulated", "display name \"\""},
                      Case{"-a=simulated", "display name \"-a\""},
                      Case{"a b=simulated", "display name \"a b\""},
                      Case{"sim=simulated,size", "\"size\", which is no KEY=VALUE"},
                      Case{"sim=simulated,", "\"\", which is no KEY=VALUE"},
                      Case{"sim=simulated,=3", "\"=3\", which is no KEY=VALUE"},
                      Case{"sim=simulated,a=1,a=2", "gives a twice"}));

TEST(DisplayOption, MessagesArePrintable) {
  for (const char* text :
       {"a\x01=simulated", "a=simulated,\x01", "a=simulated,b\n=1,b\n=2", "a\x1b"}) {
    const std::string message(ParseDisplayOption(text).status().message());
    EXPECT_FALSE(message.empty());
    for (const char c : message) EXPECT_FALSE(c >= 0 && c < 32) << message;
  }
}

}  // namespace display_config_test
}  // namespace voxeld::daemon
