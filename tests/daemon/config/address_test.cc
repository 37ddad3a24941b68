#include "daemon/address/address.h"

#include <gmock/gmock.h>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;

TEST(ParseAddress, HostsPortsAndPaths) {
  for (const char* text : {"127.0.0.1:50551", "localhost:0", "[::1]:65535", "unix:/run/a.sock"}) {
    const auto address = ParseAddress(text);
    ASSERT_TRUE(address.ok()) << address.status();
    EXPECT_EQ(address->ToString(), text);
  }
  EXPECT_EQ(ParseAddress("[::1]:5")->host, "::1");
  EXPECT_EQ(ParseAddress("[::1]:5")->port, 5);
  EXPECT_EQ(ParseAddress("unix:///run/a.sock")->path, "/run/a.sock");
  EXPECT_EQ(ParseAddress("unix:////run//a.sock")->path, "/run//a.sock");
  EXPECT_EQ(ParseAddress("unix://///")->path, "/");
  EXPECT_TRUE(ParseAddress("unix:/a")->unix_socket);
}

struct Case {
  std::string text;
  const char* why;
};

class WrongAddress : public ::testing::TestWithParam<Case> {};

TEST_P(WrongAddress, SaysWhatWouldBeRight) {
  const auto address = ParseAddress(GetParam().text);
  ASSERT_TRUE(absl::IsInvalidArgument(address.status()));
  EXPECT_THAT(std::string(address.status().message()), HasSubstr(GetParam().why));
  EXPECT_THAT(std::string(address.status().message()), HasSubstr("HOST:PORT or unix:PATH"));
}

INSTANTIATE_TEST_SUITE_P(
    Text, WrongAddress,
    ::testing::Values(Case{"", "has no port"}, Case{"localhost", "has no port"},
                      Case{":80", "has no host"}, Case{"a:", "port \"\""},
                      Case{"a:65536", "port \"65536\""}, Case{"a:-1", "port \"-1\""},
                      Case{"a:8x", "port \"8x\""}, Case{"::1:80", "more than one colon"},
                      Case{"a b:80", "host that is none"},
                      Case{"http://a:80", "more than one colon"}, Case{"unix:", "no absolute path"},
                      Case{"unix:a", "no absolute path"},
                      Case{absl::StrCat("unix:/", std::string(200, 'x')), "201 bytes"}));

}  // namespace
}  // namespace voxeld::daemon
