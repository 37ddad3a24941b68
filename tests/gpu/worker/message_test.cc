// What passes between an owner and its worker, and what else may come over their sockets.
#include "gpu/worker/message.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <set>
#include <string>
#include <vector>

namespace voxeld::gpu {
namespace {

// As it has been since kWorkerProtocol 1: type, nothing, call.
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

  // As bytes, with descriptors.
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

// What else a socket may tell beside its bytes: who sent them.
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
  EXPECT_TRUE(absl::IsUnavailable(ReceiveMessage(ends_[1]).status())) << "nothing has come";
  const Message message = MakeDone(1, absl::OkStatus());
  absl::Status sent;
  for (int i = 0; i < 1'000'000 && sent.ok(); ++i) sent = SendMessage(ends_[0], message);
  EXPECT_TRUE(absl::IsResourceExhausted(sent)) << "nobody reads: " << sent;
  close(ends_[1]);
  ends_[1] = -1;
  sent = SendMessage(ends_[0], message);
  EXPECT_TRUE(absl::IsUnavailable(sent)) << sent;
  EXPECT_EQ(sent.message().substr(0, 27), "the other process is gone: ");
  EXPECT_TRUE(absl::IsUnavailable(ReceiveMessage(ends_[0]).status()));
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
