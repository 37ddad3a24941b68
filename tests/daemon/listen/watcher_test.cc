// Tests what happens to a connection when epoll refuses it.
#include "daemon/listen/watcher.h"

#include <gmock/gmock.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <chrono>
#include <functional>
#include <thread>

#include "daemon/listen/socket.h"
#include "tests/refused_calls.h"

namespace voxeld::daemon::listen {
namespace watcher_test {

// Waits until it holds; returns false after a generous time.
bool Await(const std::function<bool()>& holds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::yield();
  }
  return true;
}

bool Ends(int client) {
  pollfd poll_fd = {client, POLLIN, 0};
  char byte = 0;
  return poll(&poll_fd, 1, 30'000) == 1 && recv(client, &byte, 1, 0) <= 0;
}

class WatcherTest : public ::testing::Test {
 protected:
  WatcherTest() {
    guard_.SetOnBusy([] {});  // the calls of authorised connections are watched
    SocketName any;
    auto* const name = reinterpret_cast<sockaddr_in*>(any.get());
    name->sin_family = AF_INET;
    name->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    any.length = sizeof(*name);
    const Descriptor listening(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(bind(listening.get(), any.get(), any.length), 0);
    EXPECT_EQ(::listen(listening.get(), 1), 0);
    EXPECT_EQ(getsockname(listening.get(), any.get(), &any.length), 0);
    client_.Reset(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(connect(client_.get(), any.get(), any.length), 0);
    SocketName other;
    served_.Reset(accept4(listening.get(), other.get(), &other.length, SOCK_CLOEXEC));
    peer_ = PeerOf(other.address, other.length);
  }

  void Start() {
    auto watcher = Watcher::Start(guard_, clock_);
    ASSERT_TRUE(watcher.ok()) << watcher.status();
    watcher_ = *std::move(watcher);
  }
  absl::Status Add() {
    return watcher_->Add(peer_, false, Descriptor(dup(served_.get()))).status();
  }
  void Authorise() { guard_.OnAnswer(peer_.name, true); }
  // A connection with bytes is armed again, as its calls are watched.
  bool AllHaveLeft() {
    return Await([this] {
      guard_.TakeBusy();
      return counters_.Read().open == 0;
    });
  }

  sync::SystemClock clock_;
  Counters counters_;
  Guard guard_{ConnectionLimits{.unauthorised_limit_ns = 3600 * sync::kSecond}, clock_, counters_,
               nullptr};
  Descriptor client_, served_;
  Peer peer_;
  std::unique_ptr<Watcher> watcher_;
};

TEST_F(WatcherTest, OneThatCannotBeArmedIsArmedTheSecondTime) {
  Start();
  ASSERT_TRUE(Add().ok());
  {
    const RefusedCalls refused(SystemCall::kEpollControl, ENOMEM);
    Authorise();
    EXPECT_EQ(refused.made(), 2);
  }
  EXPECT_EQ(send(client_.get(), "x", 1, MSG_NOSIGNAL), 1);
  std::vector<Guard::Busy> busy;
  ASSERT_TRUE(Await([&] { return !(busy = guard_.TakeBusy()).empty(); })) << "bytes are reported";
  EXPECT_EQ(busy[0].peer, peer_.name);
  char byte = 0;
  EXPECT_EQ(recv(served_.get(), &byte, 1, 0), 1) << "it was not disconnected";
  client_.Reset(-1);
  shutdown(served_.get(), SHUT_RDWR);
  EXPECT_TRUE(AllHaveLeft()) << "the close is reported";
}

TEST_F(WatcherTest, OneThatCannotBeArmedAtAllIsCutAndLeaves) {
  Start();
  ASSERT_TRUE(Add().ok());
  {
    const RefusedCalls refused(SystemCall::kEpollControl, ENOMEM, 2);
    Authorise();
    EXPECT_EQ(refused.made(), 2);
  }
  EXPECT_TRUE(Ends(client_.get()));
  EXPECT_TRUE(AllHaveLeft());
}

TEST_F(WatcherTest, OneThatIsNotWatchedYetIsNotCut) {
  Start();
  ASSERT_TRUE(Add().ok());
  {
    const RefusedCalls refused(SystemCall::kEpollControl, ENOENT);
    Authorise();
    EXPECT_EQ(refused.made(), 1);
  }
  EXPECT_EQ(send(client_.get(), "x", 1, MSG_NOSIGNAL), 1);
  char byte = 0;
  EXPECT_EQ(recv(served_.get(), &byte, 1, 0), 1) << "it was not disconnected";
  EXPECT_EQ(counters_.Read().open, 1u);
}

TEST_F(WatcherTest, OneThatIsCutAndCannotBeArmedLeavesAsWell) {
  Start();
  const auto id = watcher_->Add(peer_, false, Descriptor(dup(served_.get())));
  ASSERT_TRUE(id.ok());
  const RefusedCalls refused(SystemCall::kEpollControl, ENOMEM, 2);
  guard_.OnWrongGreeting(*id, "it says nothing that is known");
  EXPECT_TRUE(Ends(client_.get()));
  EXPECT_TRUE(AllHaveLeft());
}

TEST_F(WatcherTest, OneThatCannotBeWatchedDoesNotEnter) {
  Start();
  const RefusedCalls refused(SystemCall::kEpollControl, ENOSPC);
  const absl::Status status = Add();
  EXPECT_EQ(status, absl::ErrnoToStatus(ENOSPC, "watching a connection"));
  EXPECT_EQ(counters_.Read().open, 0u);
  EXPECT_TRUE(Add().ok());
  EXPECT_EQ(counters_.Read().open, 1u);
}

TEST_F(WatcherTest, WithoutTheSystemsMeansThereIsNone) {
  for (const SystemCall call :
       {SystemCall::kEpollCreate, SystemCall::kEventfd, SystemCall::kEpollControl}) {
    const RefusedCalls refused(call, EMFILE);
    EXPECT_EQ(Watcher::Start(guard_, clock_).status(),
              absl::ErrnoToStatus(EMFILE, "watching connections"));
  }
}

TEST_F(WatcherTest, WhoeverIsThereAtItsEndIsForgotten) {
  Start();
  ASSERT_TRUE(Add().ok());
  EXPECT_EQ(counters_.Read().open, 1u);
  watcher_.reset();
  EXPECT_EQ(counters_.Read().open, 0u);
}

}  // namespace watcher_test
}  // namespace voxeld::daemon::listen
