#include "display/drivers/network/link.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <string>
#include <vector>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "gtest/gtest.h"

namespace voxeld::display::network {
namespace {

constexpr sync::TimeNs kLimit = 20 * sync::kSecond;

// A socket of this machine on a port that was free.
class Peer {
 public:
  explicit Peer(int type) : fd_(socket(AF_INET, type | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    socklen_t size = sizeof(address);
    EXPECT_EQ(getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    if (type != SOCK_STREAM) return;
    EXPECT_EQ(listen(fd_, 4), 0);
  }
  ~Peer() { Close(); }
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }
  Endpoint endpoint() const { return {"127.0.0.1", port_}; }
  int fd() const { return fd_; }

 private:
  int fd_;
  uint16_t port_ = 0;
};

bool Readable(int fd) {
  pollfd waits{fd, POLLIN, 0};
  return poll(&waits, 1, static_cast<int>(kLimit / sync::kMillisecond)) == 1;
}

// Asks again whenever the link wakes, or a little later.
bool Await(Link& link, const std::function<bool(const absl::StatusOr<Link::State>&)>& done) {
  sync::SystemClock clock;
  sync::Mutex mutex;
  sync::CondVar condition;
  bool woken = false;
  link.SetWake([&] {
    sync::MutexLock lock(mutex);
    woken = true;
    condition.NotifyAll();
  });
  const sync::TimeNs end = clock.Now() + kLimit;
  bool is = false;
  while (!(is = done(link.Poll())) && clock.Now() < end) {
    sync::MutexLock lock(mutex);
    if (!woken) clock.WaitUntil(mutex, condition, clock.Now() + 20 * sync::kMillisecond);
    woken = false;
  }
  link.SetWake(nullptr);
  return is;
}

bool IsOpen(const absl::StatusOr<Link::State>& state) {
  return state.ok() && *state == Link::State::kOpen;
}

TEST(Endpoint, IsAnAddressInNumbers) {
  EXPECT_EQ(ParseEndpoint("192.168.1.20", 4048)->text(), "192.168.1.20:4048");
  EXPECT_EQ(ParseEndpoint("192.168.1.20:99", 4048)->text(), "192.168.1.20:99");
  EXPECT_EQ(ParseEndpoint("fd00::20", 4048)->text(), "[fd00::20]:4048");
  EXPECT_EQ(ParseEndpoint("[fd00::20]:7", 4048)->text(), "[fd00::20]:7");
  for (const char* wrong : {"", "wled.local", "1.2.3", "1.2.3.4:0", "1.2.3.4:65536", "1.2.3.4:x",
                            "[fd00::20", "[fd00::20]7", ":4048"}) {
    EXPECT_FALSE(ParseEndpoint(wrong, 4048).ok()) << wrong;
  }
}

TEST(UdpLink, SendsDatagramsWhole) {
  const Peer peer(SOCK_DGRAM);
  const auto link = MakeUdpLink(peer.endpoint());
  EXPECT_EQ(*link->Poll(), Link::State::kClosed);
  ASSERT_TRUE(link->Open().ok());
  ASSERT_TRUE(IsOpen(link->Poll()));
  const std::vector<std::byte> packet(1450, std::byte{7});
  EXPECT_EQ(*link->Send(packet), packet.size());
  ASSERT_TRUE(Readable(peer.fd()));
  std::vector<std::byte> got(4000);
  EXPECT_EQ(recv(peer.fd(), got.data(), got.size(), 0), 1450);
}

TEST(UdpLink, NobodyThereIsFoundOut) {
  Peer peer(SOCK_DGRAM);
  const auto link = MakeUdpLink(peer.endpoint());
  peer.Close();
  ASSERT_TRUE(link->Open().ok());
  EXPECT_EQ(*link->Send(std::vector<std::byte>(10)), 10u);
  absl::Status why;
  ASSERT_TRUE(Await(*link, [&](const auto& state) {
    why = state.status();
    return !why.ok();
  }));
  EXPECT_NE(why.message().find("Connection refused"), std::string::npos) << why;
}

TEST(TcpLink, SendsWhatFitsAndWakesForTheRest) {
  const Peer peer(SOCK_STREAM);
  const auto link = MakeTcpLink(peer.endpoint());
  ASSERT_TRUE(link->Open().ok());
  ASSERT_TRUE(Await(*link, IsOpen));
  const int accepted = accept(peer.fd(), nullptr, nullptr);
  ASSERT_GE(accepted, 0);
  // Until the link accepts nothing more.
  const std::vector<std::byte> bytes(1 << 20, std::byte{3});
  size_t sent = 0;
  while (true) {
    const absl::StatusOr<size_t> now = link->Send(bytes);
    ASSERT_TRUE(now.ok()) << now.status();
    if (*now == 0) break;
    sent += *now;
  }
  std::atomic<int> wakes = 0;
  link->SetWake([&] { ++wakes; });
  size_t received = 0;
  std::vector<std::byte> room(1 << 16);
  while (received < sent) {
    const ssize_t got = recv(accepted, room.data(), room.size(), 0);
    ASSERT_GT(got, 0);
    received += static_cast<size_t>(got);
  }
  ASSERT_TRUE(Await(*link, [&](const auto&) { return *link->Send(bytes) > 0; }));
  close(accepted);
  absl::Status why;
  ASSERT_TRUE(Await(*link, [&](const auto& state) {
    why = state.status();
    return !why.ok();
  }));
}

TEST(TcpLink, RefusalsAndHangUpsAreTold) {
  Peer peer(SOCK_STREAM);
  const auto link = MakeTcpLink(peer.endpoint());
  ASSERT_TRUE(link->Open().ok());
  ASSERT_TRUE(Await(*link, IsOpen));
  const int accepted = accept(peer.fd(), nullptr, nullptr);
  close(accepted);
  absl::Status why;
  const auto fails = [&](const auto& state) {
    why = state.status();
    return !why.ok();
  };
  ASSERT_TRUE(Await(*link, fails));
  EXPECT_NE(why.message().find("it hung up"), std::string::npos) << why;
  link->Close();
  peer.Close();
  const absl::Status again = link->Open();
  if (again.ok()) {
    ASSERT_TRUE(Await(*link, fails));
    EXPECT_NE(why.message().find("Connection refused"), std::string::npos) << why;
  } else {
    EXPECT_NE(again.message().find("Connection refused"), std::string::npos) << again;
  }
}

}  // namespace
}  // namespace voxeld::display::network
