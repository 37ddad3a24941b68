// Tests thousands of random packets, right, nearly right and wrong, with descriptors of all kinds.
#include <gmock/gmock.h>

#include <algorithm>
#include <map>
#include <optional>
#include <random>

#include "tests/daemon/local/socket_fixture.h"

namespace voxeld::daemon::local {
namespace {

using LocalPackets = LocalSocketTest;

constexpr int kPackets = 6000;
constexpr uint64_t kIds = 6;

class Sender {
 public:
  Sender(uint32_t seed, std::vector<std::string> tokens) : random_(seed), tokens_(tokens) {
    fds_.push_back(MakeMemfd(std::string(64, 'm')));
    fds_.push_back(MakeMemfd(std::string(5000, 'n')));
    fds_.push_back(MakeMemfd(std::string(64, 'w'), F_SEAL_GROW | F_SEAL_SHRINK));
    fds_.emplace_back(open("/dev/null", O_RDONLY));
    fds_.emplace_back(socket(AF_UNIX, SOCK_STREAM, 0));
  }

  uint64_t Below(uint64_t end) {
    return std::uniform_int_distribution<uint64_t>(0, end - 1)(random_);
  }

  std::string Bytes() {
    v1::LocalMessage message = ReleaseMessage(Below(kIds));
    if (const uint64_t kind = Below(40); kind == 0) {
      message = HelloMessage(tokens_[Below(tokens_.size())]);
    } else if (kind < 20) {
      const uint64_t size = Below(2) == 0 ? 64 : 5000;
      message = MemoryMessage(Below(kIds), Below(4) == 0 ? Below(6000) : size);
    }
    std::string bytes = message.SerializeAsString();
    if (Below(12) == 0) bytes[Below(bytes.size())] = static_cast<char>(Below(256));
    if (Below(40) == 0) bytes.resize(Below(bytes.size() + 1));
    if (Below(60) == 0) bytes.append(Below(8192), static_cast<char>(Below(256)));
    return bytes;
  }

  // Mostly the right number.
  std::vector<int> Descriptors(const std::string& bytes) {
    const bool memory = !bytes.empty() && bytes.front() == '\x12';  // the tag of field 2
    std::vector<int> fds(Below(8) == 0 ? Below(5) : memory ? 1 : 0);
    for (int& fd : fds) fd = fds_[Below(4) == 0 ? Below(fds_.size()) : Below(2)].get();
    return fds;
  }

 private:
  std::mt19937 random_;
  const std::vector<std::string> tokens_;
  std::vector<Descriptor> fds_;
};

TEST_F(LocalPackets, AtRandomHurtNobody) {
  Start({.limits = {.max_memories = 4, .max_bytes = 12'000}});
  const Tokens::Registered sessions[] = {Register(1), Register(2)}, watched = Register(3);
  LocalClient bystander = Joined(watched);
  const Descriptor fd = MakeMemfd("0123");
  ASSERT_TRUE(bystander.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  const int before = OpenDescriptors();
  std::map<v1::LocalAnswer::WhatCase, int> answers;
  int ended = 0;
  {
    Sender sender(20'240'607, {sessions[0].token, sessions[1].token, "none"});
    std::optional<LocalClient> client;
    for (int i = 0; i < kPackets; ++i) {
      const bool fresh = !client.has_value();
      if (!client.has_value()) client.emplace(path());
      const std::string bytes =
          fresh && sender.Below(8) != 0
              ? HelloMessage(sessions[sender.Below(2)].token).SerializeAsString()
              : sender.Bytes();
      client->SendBytes(bytes, fresh ? std::vector<int>() : sender.Descriptors(bytes));
      // One answer to each packet, or the end of the connection.
      const std::optional<v1::LocalAnswer> answer = client->Read();
      if (answer.has_value()) {
        ++answers[answer->what_case()];
      } else {
        ++ended;
        client.reset();
      }
      for (const Tokens::Registered& session : sessions) {
        ASSERT_LE(session.memory->memories(), 4u);
        ASSERT_LE(session.memory->bytes(), 12'000u);
        for (uint64_t id = 0; id < kIds; ++id) {
          const auto found = session.memory->Find(id, 0, 64);
          if (!found.ok()) continue;
          const char first = found->bytes.front();  // only sealed memory was accepted
          ASSERT_TRUE(first == 'm' || first == 'n');
        }
      }
    }
  }
  bystander.RoundTrips();
  EXPECT_EQ(OpenDescriptors(), before);
  EXPECT_EQ(sessions[0].memory->memories() + sessions[1].memory->memories(), 0u);
  EXPECT_EQ(watched.memory->Find(1, 0, 4)->bytes, "0123");
  // Every case has occurred.
  EXPECT_GT(answers[v1::LocalAnswer::kWelcome], 100);
  EXPECT_GT(answers[v1::LocalAnswer::kHeld], 100);
  EXPECT_GT(answers[v1::LocalAnswer::kReleased], 100);
  EXPECT_GT(answers[v1::LocalAnswer::kRefused], 100);
  EXPECT_EQ(answers[v1::LocalAnswer::WHAT_NOT_SET], 0);
  EXPECT_GT(ended, 100);
}

}  // namespace
}  // namespace voxeld::daemon::local
