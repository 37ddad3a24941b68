// Tests the messages between an owner and its worker, and what else may arrive over their sockets.
#include "gpu/worker/message.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstring>
#include <fstream>
#include <functional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace voxeld::gpu {
namespace {

// Unchanged since kWorkerProtocol 1: type, zero, call.
constexpr size_t kHeaderBytes = 16;
constexpr size_t kMostBody = 4096;

class MessageTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
    for (const int end : ends_) ASSERT_EQ(fcntl(end, F_SETFL, O_NONBLOCK), 0);
  }
  void TearDown() override {
    for (const int end : ends_) close(end);
  }

  // Sends bytes, with descriptors.
  void SendBytes(const std::string& bytes, const std::vector<int>& descriptors) {
    iovec part{const_cast<char*>(bytes.data()), bytes.size()};
    msghdr out = {};
    out.msg_iov = &part;
    out.msg_iovlen = 1;
    alignas(cmsghdr) std::array<char, 256> control = {};
    if (!descriptors.empty()) {
      const size_t size = descriptors.size() * sizeof(int);
      out.msg_control = control.data();
      out.msg_controllen = CMSG_SPACE(size);
      cmsghdr* const rights = CMSG_FIRSTHDR(&out);
      rights->cmsg_level = SOL_SOCKET;
      rights->cmsg_type = SCM_RIGHTS;
      rights->cmsg_len = CMSG_LEN(size);
      std::memcpy(CMSG_DATA(rights), descriptors.data(), size);
    }
    ASSERT_EQ(sendmsg(ends_[0], &out, 0), static_cast<ssize_t>(bytes.size()));
  }
  static std::set<int> Open() {
    std::set<int> open;
    for (int fd = 0; fd < 256; ++fd) {
      if (fcntl(fd, F_GETFD) != -1) open.insert(fd);
    }
    return open;
  }

  int ends_[2] = {-1, -1};
};

std::string Header(MessageType type, uint64_t call) {
  std::string bytes(kHeaderBytes, '\0');
  std::memcpy(bytes.data(), &type, sizeof(type));
  std::memcpy(bytes.data() + 8, &call, sizeof(call));
  return bytes;
}

TEST_F(MessageTest, ComesAsItWasSent) {
  Message sent = MakeMessage(MessageType::kBulkSegment, 77, BulkSegmentMessage{5, 4096}, "text");
  sent.fd = ends_[1];
  ASSERT_TRUE(SendMessage(ends_[0], sent).ok());
  const std::set<int> before = Open();
  const absl::StatusOr<Message> got = ReceiveMessage(ends_[1]);
  ASSERT_TRUE(got.ok()) << got.status();
  EXPECT_EQ(got->type, MessageType::kBulkSegment);
  EXPECT_EQ(got->call, 77u);
  EXPECT_EQ(got->As<BulkSegmentMessage>()->segment, 5u);
  EXPECT_EQ(got->As<BulkSegmentMessage>()->size, 4096u);
  EXPECT_EQ(got->TextAfter<BulkSegmentMessage>(), "text");
  ASSERT_GE(got->fd, 0);
  EXPECT_FALSE(before.contains(got->fd));
  EXPECT_EQ(fcntl(got->fd, F_GETFD), FD_CLOEXEC);
  struct stat here, there;
  ASSERT_EQ(fstat(ends_[1], &here), 0);
  ASSERT_EQ(fstat(got->fd, &there), 0);
  EXPECT_EQ(there.st_ino, here.st_ino);
  close(got->fd);
  EXPECT_EQ(Open(), before);
}

TEST_F(MessageTest, BytesAreHeaderThenBody) {
  const Message sent = MakeMessage(MessageType::kApply, 0x0102030405060708, BulkMessage{6, 7, 8});
  ASSERT_TRUE(SendMessage(ends_[0], sent).ok());
  std::string bytes(100, '\0');
  const ssize_t got = recv(ends_[1], bytes.data(), bytes.size(), 0);
  ASSERT_EQ(got, static_cast<ssize_t>(kHeaderBytes + sizeof(BulkMessage)));
  EXPECT_EQ(bytes.substr(0, kHeaderBytes), Header(MessageType::kApply, 0x0102030405060708));
  EXPECT_EQ(std::memcmp(bytes.data() + kHeaderBytes, sent.body.data(), sizeof(BulkMessage)), 0);
}

TEST_F(MessageTest, ADescriptorMayHaveAnyNumber) {
  const int standard_input = fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 3);
  ASSERT_GE(standard_input, 0);
  close(STDIN_FILENO);  // the next one to be opened is 0
  SendBytes(Header(MessageType::kSegment, 1), {ends_[0]});
  const absl::StatusOr<Message> got = ReceiveMessage(ends_[1]);
  EXPECT_TRUE(got.ok() && got->fd == STDIN_FILENO);
  EXPECT_TRUE(got.ok() && SendMessage(ends_[0], *got).ok());
  const absl::StatusOr<Message> again = ReceiveMessage(ends_[1]);
  EXPECT_TRUE(again.ok() && again->fd >= 0) << "0 is a descriptor too";
  if (again.ok() && again->fd >= 0) close(again->fd);
  close(STDIN_FILENO);
  SendBytes("no message", {ends_[0]});
  EXPECT_FALSE(ReceiveMessage(ends_[1]).ok());
  EXPECT_EQ(fcntl(STDIN_FILENO, F_GETFD), -1) << "closed, since it came with an invalid message";
  ASSERT_EQ(dup2(standard_input, STDIN_FILENO), STDIN_FILENO);
  close(standard_input);
}

TEST_F(MessageTest, OfOneDescriptorMoreNoneStaysOpen) {
  for (const size_t count : {2u, 3u, 20u}) {
    const std::set<int> before = Open();
    SendBytes(Header(MessageType::kSegment, 1), std::vector<int>(count, ends_[0]));
    const absl::StatusOr<Message> got = ReceiveMessage(ends_[1]);
    ASSERT_TRUE(got.ok()) << got.status();
    ASSERT_GE(got->fd, 0);
    close(got->fd);
    EXPECT_EQ(Open(), before) << count;
  }
}

TEST_F(MessageTest, OfWhatIsNoMessageTheDescriptorIsClosed) {
  const std::set<int> before = Open();
  for (const size_t size : {size_t{1}, kHeaderBytes - 1, kHeaderBytes + kMostBody + 1}) {
    for (const bool with : {false, true}) {
      SendBytes(std::string(size, 'x'), with ? std::vector<int>{ends_[0]} : std::vector<int>{});
      EXPECT_TRUE(absl::IsUnavailable(ReceiveMessage(ends_[1]).status())) << size;
      EXPECT_EQ(Open(), before) << size;
    }
  }
}

TEST_F(MessageTest, HasABodyOfUpToTheMost) {
  for (const size_t size : {size_t{0}, size_t{1}, kMostBody}) {
    SendBytes(Header(MessageType::kDone, 9) + std::string(size, 'y'), {});
    const absl::StatusOr<Message> got = ReceiveMessage(ends_[1]);
    ASSERT_TRUE(got.ok()) << got.status();
    EXPECT_EQ(got->body, std::vector<std::byte>(size, std::byte{'y'}));
    EXPECT_EQ(got->fd, -1);
  }
}

// A socket may report other things beside its bytes: their sender.
TEST_F(MessageTest, OtherThingsToldBesideAreNoDescriptor) {
  const int yes = 1;
  ASSERT_EQ(setsockopt(ends_[1], SOL_SOCKET, SO_PASSCRED, &yes, sizeof(yes)), 0);
  const std::set<int> before = Open();
  SendBytes(Header(MessageType::kDone, 9), {});
  const absl::StatusOr<Message> got = ReceiveMessage(ends_[1]);
  ASSERT_TRUE(got.ok()) << got.status();
  EXPECT_EQ(got->fd, -1);
  EXPECT_EQ(Open(), before);
}

TEST_F(MessageTest, TheEndIsToldAtBothEnds) {
  EXPECT_TRUE(absl::IsUnavailable(ReceiveMessage(ends_[1]).status())) << "nothing has arrived";
  const Message message = MakeDone(1, absl::OkStatus());
  absl::Status sent;
  for (int i = 0; i < 1'000'000 && sent.ok(); ++i) sent = SendMessage(ends_[0], message);
  EXPECT_TRUE(absl::IsResourceExhausted(sent)) << "the peer does not read: " << sent;
  close(ends_[1]);
  ends_[1] = -1;
  sent = SendMessage(ends_[0], message);
  EXPECT_TRUE(absl::IsUnavailable(sent)) << sent;
  EXPECT_EQ(sent.message().substr(0, 27), "the other process is gone: ");
  EXPECT_TRUE(absl::IsUnavailable(ReceiveMessage(ends_[0]).status()));
}

// Sleeps in a system call until a signal arrives and its handler has run, and sleeps again: twice.
class Interrupted {
 public:
  explicit Interrupted(std::function<void()> calls) {
    struct sigaction action = {};
    action.sa_handler = [](int) { handled.fetch_add(1); };  // without SA_RESTART
    sigaction(SIGUSR1, &action, &before_);
    handled = 0;
    thread_ = std::thread([this, calls = std::move(calls)] {
      id_ = gettid();
      calls();
    });
    for (int signals = 1; signals <= 2; ++signals) {
      AwaitSleep();
      pthread_kill(thread_.native_handle(), SIGUSR1);
      while (handled < signals) std::this_thread::yield();
    }
    AwaitSleep();
  }
  ~Interrupted() {
    thread_.join();
    sigaction(SIGUSR1, &before_, nullptr);
  }
  Interrupted(const Interrupted&) = delete;
  Interrupted& operator=(const Interrupted&) = delete;

 private:
  // Waits until the thread sleeps in a call, or has ended, which it should not have done yet.
  void AwaitSleep() {
    while (id_ == 0) std::this_thread::yield();
    for (char state = 'R'; state == 'R';) {
      std::this_thread::yield();
      std::ifstream stat("/proc/self/task/" + std::to_string(id_) + "/stat");
      std::string line;
      if (!std::getline(stat, line)) return;
      state = line[line.rfind(')') + 2];
    }
  }

  static std::atomic<int> handled;
  std::atomic<pid_t> id_ = 0;
  struct sigaction before_ = {};
  std::thread thread_;
};
std::atomic<int> Interrupted::handled = 0;

TEST_F(MessageTest, ASignalIsNoEnd) {
  for (const int end : ends_) ASSERT_EQ(fcntl(end, F_SETFL, 0), 0);
  absl::StatusOr<Message> got;
  {
    const Interrupted receiving([&] { got = ReceiveMessage(ends_[1]); });
    ASSERT_TRUE(SendMessage(ends_[0], MakeDone(5, absl::OkStatus())).ok());
  }
  ASSERT_TRUE(got.ok()) << got.status();
  EXPECT_EQ(got->call, 5u);

  ASSERT_EQ(fcntl(ends_[0], F_SETFL, O_NONBLOCK), 0);
  uint64_t sent = 0;
  while (SendMessage(ends_[0], MakeDone(sent, absl::OkStatus())).ok()) ++sent;
  ASSERT_EQ(fcntl(ends_[0], F_SETFL, 0), 0);
  absl::Status last = absl::UnknownError("not sent");
  {
    const Interrupted sending(
        [&] { last = SendMessage(ends_[0], MakeDone(sent, absl::OkStatus())); });
    for (uint64_t call = 0; call < sent; ++call) {
      got = ReceiveMessage(ends_[1]);
      EXPECT_TRUE(got.ok() && got->call == call);
    }
  }
  ASSERT_TRUE(last.ok()) << last;
  got = ReceiveMessage(ends_[1]);
  EXPECT_TRUE(got.ok() && got->call == sent);
}

TEST(DoneMessage, BringsAStatusThrough) {
  for (const absl::Status& status :
       {absl::OkStatus(), absl::NotFoundError("there is none"), absl::DataLossError("")}) {
    const Message done = MakeDone(3, status);
    EXPECT_EQ(done.type, MessageType::kDone);
    EXPECT_EQ(done.call, 3u);
    EXPECT_EQ(StatusOf(done), status);
  }
  const std::string most(2048, 'm');
  EXPECT_EQ(StatusOf(MakeDone(3, absl::InternalError(most + "more"))), absl::InternalError(most));
}

TEST(DoneMessage, ThatIsTooShortIsALoss) {
  for (size_t size = 0; size < sizeof(DoneMessage); ++size) {
    Message done;
    done.body.resize(size);
    EXPECT_TRUE(absl::IsDataLoss(StatusOf(done))) << size;
    EXPECT_EQ(done.TextAfter<DoneMessage>(), "");
  }
}

}  // namespace
}  // namespace voxeld::gpu
