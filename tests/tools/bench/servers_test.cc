#include "tools/bench/voxel_bench/servers.h"

#include <gtest/gtest.h>

namespace voxeld::bench {
namespace {

TEST(Status, BytesOfALineByItsWholeName) {
  const std::string text = "Name:\tvoxeld\nVmRSSx:\t   1 kB\nVmRSS:\t   52992 kB\nThreads:\t9\n";
  EXPECT_EQ(StatusBytes(text, "VmRSS"), uint64_t{52992} * 1024);
  EXPECT_EQ(StatusBytes(text, "VmHWM"), 0u);
  EXPECT_EQ(StatusBytes(text, "Name"), 0u);
  EXPECT_EQ(StatusBytes("", "VmRSS"), 0u);
}

TEST(Daemon, ThatIsNoneIsAnErrorWithItsName) {
  const auto none = ServerProcess::StartDaemon({.program = "/nowhere/voxeld"});
  EXPECT_NE(none.status().message().find("/nowhere/voxeld"), std::string::npos) << none.status();
  const auto other = ServerProcess::StartDaemon({.program = "/bin/true"});
  EXPECT_NE(other.status().message().find("/bin/true did not come up"), std::string::npos)
      << other.status();
}

}  // namespace
}  // namespace voxeld::bench
