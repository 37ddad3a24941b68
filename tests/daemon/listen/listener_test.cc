// The listener on the system's sockets: what is accepted, refused, cut, and when descriptors run out.
#include "daemon/listen/listener.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::listen {
namespace {

using std::chrono::steady_clock;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Until it holds; false after a generous time.
bool Await(const std::function<bool()>& holds) {
  const auto end = steady_clock::now() + std::chrono::seconds(30);
  while (!holds()) {
    if (steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

Descriptor Connect(const SocketName& name) {
  Descriptor client(socket(name.address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
  EXPECT_TRUE(client.ok()) << std::strerror(errno);
  if (connect(client.get(), name.get(), name.length) != 0) client.Reset(-1);
  return client;
}

// Whether the other end closed, or cut, the connection in a generous time; what comes is thrown away.
bool Ends(int client) {
  for (;;) {
    pollfd poll_fd = {client, POLLIN, 0};
    if (poll(&poll_fd, 1, 30'000) != 1) return false;
    char buffer[4096];
    if (recv(client, buffer, sizeof(buffer), 0) <= 0) return true;
  }
}

class ListenerTest : public ::testing::Test {
 protected:
  ListenerTest() {
    folder_ = (std::filesystem::temp_directory_path() / "voxeld-test-XXXXXX").string();
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
  }
  ~ListenerTest() override {
    listener_.reset();
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  // Names of what listens.
  std::vector<SocketName> Start(const std::string& text, const ConnectionLimits& limits = {}) {
    auto sockets = ListeningSocket::Listen(*ParseAddress(text));
    EXPECT_TRUE(sockets.ok()) << sockets.status();
    std::vector<SocketName> names;
    for (const ListeningSocket& socket : *sockets) names.push_back(socket.name());
    guard_ = std::make_unique<Guard>(limits, clock_, counters_, nullptr);
    auto listener = Listener::Start(*std::move(sockets), *guard_, counters_, own_, clock_,
                                    [this](int, Descriptor connection) {
                                      sync::MutexLock lock(mutex_);
                                      served_.push_back(std::move(connection));
                                    },
                                    {});
    EXPECT_TRUE(listener.ok()) << listener.status();
    listener_ = *std::move(listener);
    return names;
  }

  size_t served() {
    sync::MutexLock lock(mutex_);
    return served_.size();
  }
  void CloseServed() {
    sync::MutexLock lock(mutex_);
    for (const Descriptor& descriptor : served_) shutdown(descriptor.get(), SHUT_RDWR);
    served_.clear();
  }

  sync::SystemClock clock_;
  Counters counters_;
  OwnPeers own_;
  std::string folder_;
  sync::Mutex mutex_;
  std::vector<Descriptor> served_ VOXELD_GUARDED_BY(mutex_);
  std::unique_ptr<Guard> guard_;
  std::unique_ptr<Listener> listener_;
};

TEST_F(ListenerTest, AHostWithSeveralNumbersHasOnePort) {
  const std::vector<SocketName> names = Start("localhost:0");
  ASSERT_FALSE(names.empty());
  const in_port_t port = reinterpret_cast<const sockaddr_in*>(&names[0].address)->sin_port;
  EXPECT_NE(port, 0);
  for (const SocketName& name : names) {  // the port lies at the same place in both families
    EXPECT_EQ(reinterpret_cast<const sockaddr_in*>(&name.address)->sin_port, port);
    EXPECT_TRUE(Connect(name).ok());
  }
  EXPECT_TRUE(Await([&] { return served() == names.size(); }));
}

TEST_F(ListenerTest, HandsOverSocketsThatDoNotBlock) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  const Descriptor client = Connect(names[0]);
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  sync::MutexLock lock(mutex_);
  EXPECT_NE(fcntl(served_[0].get(), F_GETFL) & O_NONBLOCK, 0);
  EXPECT_NE(fcntl(served_[0].get(), F_GETFD) & FD_CLOEXEC, 0);
}

TEST_F(ListenerTest, AUnixSocketIsForUserAndGroupAndGoesWithTheListener) {
  const std::string path = folder_ + "/a.sock";
  const std::vector<SocketName> names = Start("unix:" + path);
  struct stat found;
  ASSERT_EQ(stat(path.c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 07777, 0660u);
  const Descriptor client = Connect(names[0]);
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  listener_->StopAccepting();
  EXPECT_FALSE(std::filesystem::exists(path));
  const SocketName name = names[0];
  Descriptor late(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  EXPECT_NE(connect(late.get(), name.get(), name.length), 0);
  EXPECT_EQ(send(client.get(), "x", 1, MSG_NOSIGNAL), 1) << "what is open stays";
}

TEST_F(ListenerTest, AFileThatIsNotItsOwnStays) {
  const std::string path = folder_ + "/a.sock";
  Start("unix:" + path);
  std::filesystem::remove(path);
  std::ofstream(path) << "another's";
  listener_.reset();
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST_F(ListenerTest, OverTheLimitIsClosedAtOnceAndAPlaceThatGetsFreeIsFree) {
  const std::vector<SocketName> names = Start("127.0.0.1:0", {.max_connections_per_address = 3});
  std::vector<Descriptor> clients;
  for (int i = 0; i < 3; ++i) clients.push_back(Connect(names[0]));
  ASSERT_TRUE(Await([&] { return served() == 3; }));
  const Descriptor refused = Connect(names[0]);
  EXPECT_TRUE(Ends(refused.get()));
  EXPECT_EQ(counters_.Read().refused_by_address, 1u);
  clients.clear();
  CloseServed();
  EXPECT_TRUE(Await([&] { return counters_.Read().open == 0; }));
  const Descriptor next = Connect(names[0]);
  EXPECT_TRUE(Await([&] { return served() == 1; }));
}

TEST_F(ListenerTest, ItsOwnIsNotCounted) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.max_connections = 1, .max_connections_per_address = 1});
  const Descriptor client = Connect(names[0]);
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  Descriptor own(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  SocketName name = names[0];
  reinterpret_cast<sockaddr_in*>(&name.address)->sin_port = 0;
  ASSERT_EQ(bind(own.get(), name.get(), name.length), 0);
  name.length = sizeof(name.address);
  ASSERT_EQ(getsockname(own.get(), name.get(), &name.length), 0);
  own_.Add(PeerOf(name.address, name.length).name);
  ASSERT_EQ(connect(own.get(), names[0].get(), names[0].length), 0);
  EXPECT_TRUE(Await([&] { return served() == 2; }));
  EXPECT_EQ(counters_.Read().accepted, 1u);
}

TEST_F(ListenerTest, BytesBeyondTheLimitAreCutThoughNobodyReadsThem) {
  const std::vector<SocketName> names = Start("127.0.0.1:0", {.unauthorised_bytes = 4096});
  const Descriptor client = Connect(names[0]);
  const std::string half(2048, 'x');
  ASSERT_EQ(send(client.get(), half.data(), half.size(), MSG_NOSIGNAL), 2048);
  ASSERT_EQ(send(client.get(), half.data(), half.size(), MSG_NOSIGNAL), 2048);
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  EXPECT_EQ(counters_.Read().cut_for_bytes, 0u);
  send(client.get(), "x", 1, MSG_NOSIGNAL);
  EXPECT_TRUE(Ends(client.get()));
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
  EXPECT_TRUE(Await([&] { return counters_.Read().open == 0; }));
}

TEST_F(ListenerTest, SilenceIsCutInTime) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.unauthorised_limit_ns = 100 * sync::kMillisecond});
  const auto begin = steady_clock::now();
  const Descriptor client = Connect(names[0]);
  EXPECT_TRUE(Ends(client.get()));
  EXPECT_GE(steady_clock::now() - begin, std::chrono::milliseconds(100));
  EXPECT_EQ(counters_.Read().cut_for_time, 1u);
}

// Lowers the process' limit to what is open and a few more, until it goes.
class FewDescriptors {
 public:
  explicit FewDescriptors(rlim_t more) {
    getrlimit(RLIMIT_NOFILE, &before_);
    rlimit low = before_;
    const Descriptor next(fcntl(0, F_DUPFD_CLOEXEC, 0));
    low.rlim_cur = static_cast<rlim_t>(next.get()) + more;
    setrlimit(RLIMIT_NOFILE, &low);
  }
  ~FewDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_ = {};
};

TEST_F(ListenerTest, AcceptsAgainWhenDescriptorsComeBack) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  constexpr size_t kClients = 6;
  for (int cycle = 1; cycle <= 3; ++cycle) {
    std::vector<Descriptor> clients;
    for (size_t i = 0; i < kClients; ++i) {
      clients.emplace_back(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    }
    {
      const FewDescriptors few(5);  // two connections of two, and an odd one
      const uint64_t failures = counters_.Read().accept_failures;
      for (Descriptor& client : clients) {
        connect(client.get(), names[0].get(), names[0].length);
      }
      ASSERT_TRUE(Await([&] { return counters_.Read().accept_failures > failures; }));
      EXPECT_LT(served(), kClients);
    }
    const auto begin = steady_clock::now();
    // The one whose second descriptor could not be had was closed; it alone is lost.
    EXPECT_TRUE(Await([&] { return served() >= kClients - 1; })) << served();
    EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(1));
    CloseServed();
    ASSERT_TRUE(Await([&] { return counters_.Read().open == 0; }));
  }
}

}  // namespace
}  // namespace voxeld::daemon::listen
