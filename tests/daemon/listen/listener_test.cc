// Tests the listener on the system's sockets: which connections are accepted, refused and closed,
// and running out of descriptors.
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
#include <string_view>
#include <thread>

#include "absl/strings/str_cat.h"
#include "daemon/listen/greeting.h"

namespace voxeld::daemon::listen {
namespace listener_test {

using std::chrono::steady_clock;
using ::testing::HasSubstr;

// Waits until it holds; returns false after a generous time.
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

// Returns whether the peer closed or reset the connection within a generous time; discards received
// bytes.
bool Ends(int client) {
  for (;;) {
    pollfd poll_fd = {client, POLLIN, 0};
    if (poll(&poll_fd, 1, 30'000) != 1) return false;
    char buffer[4096];
    if (recv(client, buffer, sizeof(buffer), 0) <= 0) return true;
  }
}

// The beginning of a call: empty headers, and a message of three bytes.
constexpr std::string_view kPreface = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";
constexpr std::string_view kSettings{"\0\0\0\4\0\0\0\0\0", 9};
constexpr std::string_view kCall{
    "\0\0\2\1\4\0\0\0\1hh"
    "\0\0\x8\0\0\0\0\0\1\0\0\0\0\3abc",
    28};

void Send(int client, std::string_view bytes) {
  EXPECT_EQ(send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(bytes.size()))
      << std::strerror(errno);
}
void Speak(int client) { Send(client, std::string(kPreface).append(kSettings).append(kCall)); }

std::string ReadBytes(int descriptor, size_t count) {
  std::string out(count, '\0');
  size_t at = 0;
  while (at < count) {
    pollfd poll_fd = {descriptor, POLLIN, 0};
    if (poll(&poll_fd, 1, 30'000) != 1) break;
    const ssize_t n = recv(descriptor, out.data() + at, count - at, 0);
    if (n <= 0) break;
    at += static_cast<size_t>(n);
  }
  return out.substr(0, at);
}

std::string NameOf(int client) {
  SocketName name;
  EXPECT_EQ(getsockname(client, name.get(), &name.length), 0);
  return PeerOf(name.address, name.length).name;
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

  // Returns the names of the sockets that listen.
  std::vector<SocketName> Start(const std::string& text, const ConnectionLimits& limits = {}) {
    auto sockets = ListeningSocket::Listen(*ParseAddress(text));
    EXPECT_TRUE(sockets.ok()) << sockets.status();
    std::vector<SocketName> names;
    for (const ListeningSocket& socket : *sockets) names.push_back(socket.name());
    guard_ = std::make_unique<Guard>(limits, clock_, counters_, nullptr);
    auto listener = Listener::Start(*std::move(sockets), *guard_, counters_, own_, clock_,
                                    [this](const Accepted& accepted, Descriptor connection) {
                                      sync::MutexLock lock(mutex_);
                                      accepted_ = accepted;
                                      served_.push_back(std::move(connection));
                                      return true;
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
  int served_descriptor(size_t i) {
    sync::MutexLock lock(mutex_);
    return served_[i].get();
  }
  Accepted last_accepted() {
    sync::MutexLock lock(mutex_);
    return accepted_;
  }
  uint64_t accepted() { return counters_.Read().accepted; }
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
  Accepted accepted_ VOXELD_GUARDED_BY(mutex_);
  std::vector<Descriptor> served_ VOXELD_GUARDED_BY(mutex_);
  std::unique_ptr<Guard> guard_;
  std::unique_ptr<Listener> listener_;
};

TEST_F(ListenerTest, ASocketThatCannotBeWatchedIsAnErrorAtTheStart) {
  std::vector<ListeningSocket> sockets = *ListeningSocket::Listen(*ParseAddress("127.0.0.1:0"));
  const ListeningSocket elsewhere(
      std::move(sockets.front()));  // the one that stays has no descriptor
  guard_ = std::make_unique<Guard>(ConnectionLimits(), clock_, counters_, nullptr);
  const auto serve = [](const Accepted&, const Descriptor&) { return true; };
  const absl::Status refused =
      Listener::Start(std::move(sockets), *guard_, counters_, own_, clock_, serve, {}).status();
  EXPECT_EQ(refused.message(), "the listener: Bad file descriptor");
}

TEST_F(ListenerTest, AHostWithSeveralNumbersHasOnePort) {
  const std::vector<SocketName> names = Start("localhost:0");
  ASSERT_FALSE(names.empty());
  const in_port_t port = reinterpret_cast<const sockaddr_in*>(&names[0].address)->sin_port;
  EXPECT_NE(port, 0);
  for (const SocketName& name : names) {  // the port is at the same place in both families
    EXPECT_EQ(reinterpret_cast<const sockaddr_in*>(&name.address)->sin_port, port);
    EXPECT_TRUE(Connect(name).ok());
  }
  EXPECT_TRUE(Await([&] { return accepted() == names.size(); }));
}

TEST_F(ListenerTest, HandsOverSocketsThatDoNotBlock) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  const Descriptor client = Connect(names[0]);
  Speak(client.get());
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
  EXPECT_EQ(send(client.get(), "x", 1, MSG_NOSIGNAL), 1) << "open connections stay";
}

TEST_F(ListenerTest, AFileThatIsNotItsOwnStays) {
  const std::string path = folder_ + "/a.sock";
  Start("unix:" + path);
  std::filesystem::remove(path);
  std::ofstream(path) << "another's";
  listener_.reset();
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST_F(ListenerTest, AStrangerIsServedOnceACallBeginsAndAllItSaidIsThere) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  const Descriptor client = Connect(names[0]);
  Send(client.get(), kPreface);
  EXPECT_EQ(ReadBytes(client.get(), 9), Greeting::kServerSettings)
      << "clients wait for these before they call";
  Send(client.get(), kSettings);
  for (const char byte : kCall.substr(0, kCall.size() - 4)) {
    EXPECT_EQ(served(), 0u);
    Send(client.get(), {&byte, 1});
  }
  Send(client.get(), kCall.substr(kCall.size() - 4));
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  const std::string all = std::string(kPreface).append(kSettings).append(kCall);
  EXPECT_EQ(ReadBytes(served_descriptor(0), all.size()), all);
}

TEST_F(ListenerTest, AStrangerWhoseGreetingIsNoneIsCutAndItsAddressRefused) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.cut_penalty_ns = 3600 * sync::kSecond});
  const Descriptor client = Connect(names[0]);
  Send(client.get(), "GET / HTTP/1.1\r\n\r\n");
  EXPECT_TRUE(Ends(client.get()));
  EXPECT_TRUE(Await([&] { return counters_.Read().open == 0; }));
  const Descriptor next = Connect(names[0]);
  EXPECT_TRUE(Ends(next.get()));
  EXPECT_EQ(served(), 0u);
  EXPECT_EQ(counters_.Read().cut_for_greeting, 1u);
  EXPECT_EQ(counters_.Read().refused_after_cut, 1u);
}

TEST_F(ListenerTest, ThoseThatAreRefusedAreTakenAtAMeasuredPace) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.cut_penalty_ns = 3600 * sync::kSecond});
  const Descriptor cut = Connect(names[0]);
  Send(cut.get(), "GET / HTTP/1.1\r\n\r\n");
  ASSERT_TRUE(Ends(cut.get()));
  ASSERT_TRUE(Await([&] { return counters_.Read().open == 0; }));

  constexpr int kIntervals = 5;
  constexpr int kMany = kIntervals * Listener::kRefusals + 1;
  const sync::TimeNs begin = clock_.Now();
  for (int i = 0; i < kMany; ++i) EXPECT_TRUE(Ends(Connect(names[0]).get()));
  EXPECT_EQ(counters_.Read().refused_after_cut, uint64_t{kMany});
  EXPECT_GE(clock_.Now() - begin, kIntervals * Listener::kRefusalInterval);
  EXPECT_EQ(served(), 0u);
}

TEST_F(ListenerTest, AStrangerWhoGoesIsGoneAtOnce) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.unauthorised_limit_ns = 3600 * sync::kSecond});
  for (const std::string_view bytes : {std::string_view(), kPreface}) {
    Descriptor client = Connect(names[0]);
    if (!bytes.empty()) Send(client.get(), bytes);
    ASSERT_TRUE(Await([&] { return counters_.Read().open == 1; }));
    client.Reset(-1);
    EXPECT_TRUE(Await([&] { return counters_.Read().open == 0; }));
  }
}

TEST_F(ListenerTest, AStrangerIsLetGoWhenNothingIsAcceptedAnyMore) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  const Descriptor client = Connect(names[0]);
  Send(client.get(), kPreface);
  ASSERT_EQ(ReadBytes(client.get(), 9).size(), 9u);
  listener_->StopAccepting();
  EXPECT_TRUE(Ends(client.get()));
  EXPECT_EQ(served(), 0u);
}

TEST_F(ListenerTest, OverTheLimitIsClosedAtOnceAndAPlaceThatGetsFreeIsFree) {
  const std::vector<SocketName> names = Start("127.0.0.1:0", {.max_connections_per_address = 3});
  std::vector<Descriptor> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(Connect(names[0]));
    Speak(clients.back().get());
  }
  ASSERT_TRUE(Await([&] { return served() == 3; }));
  for (const Descriptor& client : clients) guard_->OnAnswer(NameOf(client.get()), true);
  const Descriptor refused = Connect(names[0]);
  EXPECT_EQ(ReadBytes(refused.get(), Greeting::kRefusal.size()), Greeting::kRefusal);
  EXPECT_TRUE(Ends(refused.get()));
  EXPECT_EQ(counters_.Read().refused_by_address, 1u);
  clients.clear();
  CloseServed();
  EXPECT_TRUE(Await([&] { return counters_.Read().open == 0; }));
  const Descriptor next = Connect(names[0]);
  EXPECT_TRUE(Await([&] { return counters_.Read().open == 1; }));
}

TEST_F(ListenerTest, ItsOwnIsNotCounted) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.max_connections = 1, .max_connections_per_address = 1});
  const Descriptor client = Connect(names[0]);
  Speak(client.get());
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  Descriptor own(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  SocketName name = names[0];
  reinterpret_cast<sockaddr_in*>(&name.address)->sin_port = 0;
  ASSERT_EQ(bind(own.get(), name.get(), name.length), 0);
  own_.Add(NameOf(own.get()));
  ASSERT_EQ(connect(own.get(), names[0].get(), names[0].length), 0);
  Speak(own.get());
  EXPECT_TRUE(Await([&] { return served() == 2; }));
  EXPECT_EQ(counters_.Read().accepted, 1u);
}

TEST_F(ListenerTest, BytesBeyondTheLimitAreCutThoughNobodyReadsThem) {
  const std::vector<SocketName> names = Start("127.0.0.1:0", {.unauthorised_bytes = 4096});
  const Descriptor client = Connect(names[0]);
  Speak(client.get());
  Send(client.get(), std::string(3000, 'x'));
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  EXPECT_EQ(counters_.Read().cut_for_bytes, 0u);
  Send(client.get(), std::string(1096, 'x'));
  EXPECT_TRUE(Ends(client.get()));
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
  EXPECT_TRUE(Await([&] { return counters_.Read().open == 0; }));
}

// As gRPC does: reads everything that has arrived, at once.
TEST_F(ListenerTest, WhoReadsAllThatComesGetsNoMoreThanTheLimitBeforeTheCut) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  const Descriptor client = Connect(names[0]);
  Speak(client.get());
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  const int descriptor = served_descriptor(0);
  uint64_t got = 0;
  std::thread reader([&] {
    std::string buffer(1 << 20, '\0');
    for (;;) {
      pollfd poll_fd = {descriptor, POLLIN, 0};
      if (poll(&poll_fd, 1, 30'000) != 1) return;
      const ssize_t n = recv(descriptor, buffer.data(), buffer.size(), 0);
      if (n <= 0) return;
      got += static_cast<uint64_t>(n);
    }
  });
  const std::string some(256 << 10, 'x');
  while (send(client.get(), some.data(), some.size(), MSG_NOSIGNAL) > 0) {
  }
  reader.join();
  // Including what had arrived before the listener had the connection.
  EXPECT_LE(got, 65u << 10);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 1u);
}

TEST_F(ListenerTest, WhoIsAuthorisedGetsAllThroughAgain) {
  const std::vector<SocketName> names = Start("127.0.0.1:0");
  const Descriptor client = Connect(names[0]);
  Speak(client.get());
  ASSERT_TRUE(Await([&] { return served() == 1; }));
  const int descriptor = served_descriptor(0);
  int narrow = 0, wide = 0;
  socklen_t length = sizeof(int);
  ASSERT_EQ(getsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &narrow, &length), 0);
  guard_->OnAnswer(NameOf(client.get()), true);
  ASSERT_EQ(getsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &wide, &length), 0);
  EXPECT_GT(wide, 2 * narrow);
  const std::string much(32 << 20, 'x');
  std::thread writer([&] { Send(client.get(), much); });
  const size_t before = kPreface.size() + kSettings.size() + kCall.size();
  EXPECT_EQ(ReadBytes(descriptor, before + much.size()).size(), before + much.size());
  writer.join();
  ASSERT_EQ(getsockopt(descriptor, SOL_SOCKET, SO_RCVBUF, &wide, &length), 0);
  EXPECT_EQ(counters_.Read().cut_for_bytes, 0u);
}

TEST_F(ListenerTest, SilenceIsCutInTime) {
  const std::vector<SocketName> names =
      Start("127.0.0.1:0", {.unauthorised_limit_ns = 160 * sync::kMillisecond});
  const auto begin = steady_clock::now();
  const Descriptor client = Connect(names[0]);
  EXPECT_TRUE(Ends(client.get()));
  EXPECT_GE(steady_clock::now() - begin, std::chrono::milliseconds(150));
  EXPECT_EQ(counters_.Read().cut_for_time, 1u);
}

// Lowers the process' limit to the open descriptors and a few more, until it is destroyed.
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
  for (int cycle = 1; cycle <= 4; ++cycle) {
    std::vector<Descriptor> clients;
    for (size_t i = 0; i < kClients; ++i) {
      clients.emplace_back(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    }
    {
      const FewDescriptors few(cycle % 2 == 0 ? 5 : 4);  // two connections; and an odd descriptor
      const uint64_t failures = counters_.Read().accept_failures;
      for (Descriptor& client : clients) {
        (void)connect(client.get(), names[0].get(), names[0].length);
        Speak(client.get());  // the system's queue has connected it
      }
      ASSERT_TRUE(Await([&] { return counters_.Read().accept_failures > failures; }));
      EXPECT_LT(served(), kClients);
    }
    const sync::TimeNs now = clock_.Now();
    EXPECT_THAT(counters_.Read(now).accept_trouble, HasSubstr("Too many open files"));
    EXPECT_EQ(counters_.Read(now + Counters::kTold).accept_trouble, "");
    EXPECT_EQ(counters_.Read().accept_trouble, "") << "without a time";
    const auto begin = steady_clock::now();
    EXPECT_TRUE(Await([&] { return served() == kClients; }))
        << served() << ": no client is lost; in cycle " << cycle << ", accepted " << accepted()
        << ", open " << counters_.Read().open << ", failures " << counters_.Read().accept_failures
        << ", cut for time " << counters_.Read().cut_for_time;
    EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(1));
    CloseServed();
    ASSERT_TRUE(Await([&] { return counters_.Read().open == 0; }));
  }
}

}  // namespace listener_test
}  // namespace voxeld::daemon::listen
