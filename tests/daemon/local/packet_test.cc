// Tests single packets: what is read from them, and the errors for invalid ones.
#include "daemon/local/packet.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <string>
#include <vector>

#include "voxeld/v1/local.pb.h"

namespace voxeld::daemon::local {
namespace packet_test {

using ::testing::HasSubstr;

class PacketTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_), 0);
  }
  void TearDown() override {
    close(ends_[0]);
    if (ends_[1] >= 0) close(ends_[1]);
  }
  // Sends a packet with that many descriptors.
  void Send(const std::string& bytes, size_t descriptors = 0) {
    std::string sent = bytes;
    iovec part = {sent.data(), sent.size()};
    msghdr header = {};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    std::vector<char> control(CMSG_SPACE(descriptors * sizeof(int)));
    const std::vector<int> all(descriptors, null_);
    if (descriptors > 0) {
      header.msg_control = control.data();
      header.msg_controllen = control.size();
      cmsghdr* const at = CMSG_FIRSTHDR(&header);
      at->cmsg_level = SOL_SOCKET;
      at->cmsg_type = SCM_RIGHTS;
      at->cmsg_len = CMSG_LEN(descriptors * sizeof(int));
      std::memcpy(CMSG_DATA(at), all.data(), descriptors * sizeof(int));
    }
    ASSERT_EQ(sendmsg(ends_[1], &header, 0), static_cast<ssize_t>(bytes.size()));
  }
  Packet Get(size_t room = kDescriptors) { return Receive(ends_[0], room); }

  int ends_[2] = {-1, -1};
  const int null_ = open("/dev/null", O_RDONLY | O_CLOEXEC);
};

TEST_F(PacketTest, IsTakenAsItCame) {
  EXPECT_EQ(Get().what, Packet::What::kNothing);
  Send("abc", 1);
  const Packet packet = Get();
  EXPECT_EQ(packet.what, Packet::What::kPacket);
  EXPECT_EQ(packet.bytes, "abc");
  EXPECT_EQ(packet.descriptors.size(), 1u);
  EXPECT_FALSE(packet.truncated || packet.more_descriptors || packet.descriptors_lost);
  EXPECT_EQ(Get().what, Packet::What::kNothing) << "there was one";
  close(ends_[1]);
  ends_[1] = -1;
  EXPECT_EQ(Get().what, Packet::What::kEnd);
}

TEST_F(PacketTest, OfASocketThatIsNoneIsTheEnd) {
  EXPECT_EQ(Receive(-1, kDescriptors).what, Packet::What::kEnd);
}

TEST_F(PacketTest, BringsNoMoreDescriptorsThanThereIsRoomFor) {
  Send("three", 3);
  Packet packet = Get();
  EXPECT_EQ(packet.descriptors.size(), kDescriptors);
  EXPECT_TRUE(packet.more_descriptors);
  EXPECT_FALSE(packet.descriptors_lost);
  Send("one", 1);
  packet = Get(kNoDescriptors);
  EXPECT_EQ(packet.bytes, "one");
  EXPECT_TRUE(packet.descriptors.empty());
  EXPECT_TRUE(packet.more_descriptors);
  Send("none");
  EXPECT_FALSE(Get(kNoDescriptors).more_descriptors);
}

TEST_F(PacketTest, WhoSentItIsNoDescriptor) {
  const int on = 1;
  ASSERT_EQ(setsockopt(ends_[0], SOL_SOCKET, SO_PASSCRED, &on, sizeof(on)), 0);
  Send("credentials");
  const Packet packet = Get();
  EXPECT_EQ(packet.bytes, "credentials");
  EXPECT_TRUE(packet.descriptors.empty());
}

TEST_F(PacketTest, OfTheGreatestSizeIsWholeAndOneMoreIsNot) {
  Send(std::string(kGreatestPacket, 'x'));
  Packet packet = Get();
  EXPECT_EQ(packet.bytes.size(), kGreatestPacket);
  EXPECT_FALSE(packet.truncated);
  Send(std::string(kGreatestPacket + 1, 'x'));
  packet = Get();
  EXPECT_TRUE(packet.truncated);
  const absl::Status status = ParseMessage(packet).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status));
  EXPECT_THAT(std::string(status.message()), HasSubstr("that is the most"));
}

TEST(LocalMessages, AreToldApart) {
  Packet packet;
  v1::LocalMessage message;
  message.mutable_hello()->set_token("token");
  packet.bytes = message.SerializeAsString();
  absl::StatusOr<Message> read = ParseMessage(packet);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->what, Message::What::kHello);
  EXPECT_EQ(read->token, "token");
  message.mutable_memory()->set_id(7);
  message.mutable_memory()->set_size(9);
  packet.bytes = message.SerializeAsString();
  read = ParseMessage(packet);
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->what, Message::What::kMemory);
  EXPECT_EQ(read->id, 7u);
  EXPECT_EQ(read->size, 9u);
  message.mutable_release()->set_id(8);
  packet.bytes = message.SerializeAsString();
  read = ParseMessage(packet);
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->what, Message::What::kRelease);
  EXPECT_EQ(read->id, 8u);
  packet.bytes = "";
  EXPECT_THAT(std::string(ParseMessage(packet).status().message()),
              HasSubstr("says nothing this version"));
  packet.bytes = "\xFF";
  EXPECT_EQ(ParseMessage(packet).status().message(),
            "a packet of 1 bytes is not a voxeld.v1.LocalMessage");
}

TEST(LocalMessages, AnswersSayWhatTheyAreToSay) {
  v1::LocalAnswer answer;
  ASSERT_TRUE(answer.ParseFromString(Welcome(3, 5)));
  EXPECT_EQ(answer.welcome().max_memories(), 3u);
  EXPECT_EQ(answer.welcome().max_bytes(), 5u);
  ASSERT_TRUE(answer.ParseFromString(Held(7)));
  EXPECT_EQ(answer.held().id(), 7u);
  ASSERT_TRUE(answer.ParseFromString(Released(8)));
  EXPECT_EQ(answer.released().id(), 8u);
  ASSERT_TRUE(answer.ParseFromString(Refused(9, "why")));
  EXPECT_EQ(answer.refused().id(), 9u);
  EXPECT_EQ(answer.refused().message(), "why");
}

}  // namespace packet_test
}  // namespace voxeld::daemon::local
