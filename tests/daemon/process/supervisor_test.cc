#include "daemon/process/supervisor.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <map>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {
namespace {

Supervisor::Environment Of(std::map<std::string, std::string> variables) {
  return [variables = std::move(variables)](const char* name) -> std::optional<std::string> {
    const auto found = variables.find(name);
    if (found == variables.end()) return {};
    return found->second;
  };
}

// The socket on which a supervisor listens.
class Ear {
 public:
  explicit Ear(const std::string& path) : socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un name = {};
    name.sun_family = AF_UNIX;
    std::memcpy(name.sun_path, path.data(), path.size());
    socklen_t length = sizeof(name);
    if (path.front() == '@') {
      name.sun_path[0] = '\0';
      length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size());
    }
    EXPECT_EQ(bind(socket_.get(), reinterpret_cast<const sockaddr*>(&name), length), 0);
  }
  std::string Hear() {
    char text[4096];
    const ssize_t n = recv(socket_.get(), text, sizeof(text), MSG_DONTWAIT);
    return n < 0 ? "nothing" : std::string(text, static_cast<size_t>(n));
  }

 private:
  Descriptor socket_;
};

TEST(Supervisor, IsToldOnAPathAndOnAnAbstractName) {
  const std::string path = absl::StrCat(::testing::TempDir(), "/voxeld-notify-", getpid());
  for (const std::string& name : {path, absl::StrCat("@voxeld-test-", getpid())}) {
    Ear ear(name);
    const Supervisor supervisor(Of({{"NOTIFY_SOCKET", name}}));
    EXPECT_TRUE(supervisor.present());
    supervisor.Ready("2 displays\nWATCHDOG=trigger");
    EXPECT_EQ(ear.Hear(), "READY=1\nSTATUS=2 displays WATCHDOG=trigger");
    supervisor.Alive();
    EXPECT_EQ(ear.Hear(), "WATCHDOG=1");
    supervisor.Status("busy");
    EXPECT_EQ(ear.Hear(), "STATUS=busy");
    supervisor.Stopping();
    EXPECT_EQ(ear.Hear(), "STOPPING=1\nSTATUS=shutting down");
    EXPECT_EQ(ear.Hear(), "nothing");
  }
  unlink(path.c_str());
}

TEST(Supervisor, ThatIsNotThereIsToldNothing) {
  for (const std::string& name : {std::string(), std::string("relative"), std::string(200, '/'),
                                  std::string("/nowhere/at/all")}) {
    const Supervisor supervisor(Of({{"NOTIFY_SOCKET", name}}));
    supervisor.Ready("");
    supervisor.Alive();
  }
  EXPECT_FALSE(Supervisor(Of({})).present());
}

TEST(Supervisor, TheWatchdogIsOfTheProcessThatItNames) {
  const std::string mine = absl::StrCat(getpid()), others = absl::StrCat(getpid() + 1);
  EXPECT_EQ(Supervisor(Of({{"WATCHDOG_USEC", "30000000"}})).watchdog_ns(), 30 * sync::kSecond);
  EXPECT_EQ(Supervisor(Of({{"WATCHDOG_USEC", "7"}, {"WATCHDOG_PID", mine}})).watchdog_ns(), 7000);
  EXPECT_EQ(Supervisor(Of({{"WATCHDOG_USEC", "7"}, {"WATCHDOG_PID", others}})).watchdog_ns(), 0);
  EXPECT_EQ(Supervisor(Of({{"WATCHDOG_USEC", "soon"}})).watchdog_ns(), 0);
  EXPECT_EQ(Supervisor(Of({{"WATCHDOG_USEC", "-1"}})).watchdog_ns(), 0);
}

TEST(Supervisor, SocketsOfAnotherProcessAreLeftAlone) {
  EXPECT_TRUE(Supervisor(Of({{"LISTEN_FDS", "2"}, {"LISTEN_PID", absl::StrCat(getpid() + 1)}}))
                  .TakeSockets()
                  .empty());
  EXPECT_TRUE(Supervisor(Of({{"LISTEN_FDS", "2"}})).TakeSockets().empty());
  EXPECT_TRUE(Supervisor(Of({{"LISTEN_FDS", "0"}, {"LISTEN_PID", absl::StrCat(getpid())}}))
                  .TakeSockets()
                  .empty());
}

}  // namespace
}  // namespace voxeld::daemon
