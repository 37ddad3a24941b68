// The local socket, and a malicious producer: packets over a real socket, with memfds of every size
// and seal, with answers read or left unread, while the server has descriptors and memory left, or
// not. Each packet has one answer; held memory counts, and is released with the connection.

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/budget.h"
#include "daemon/local/connection.h"
#include "daemon/local/doorbell.h"
#include "daemon/local/tokens.h"
#include "daemon/log/logger.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"
#include "voxeld/v1/local.pb.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon;  // NOLINT(google-build-using-namespace)

Logger& Log() {
  static const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  static Logger log(Logger::Level::kInfo, Logger::Format::kText, nowhere);
  return log;
}

// While it exists, this process can open nothing.
class NoDescriptors {
 public:
  NoDescriptors() {
    getrlimit(RLIMIT_NOFILE, &before_);
    const rlimit none = {0, before_.rlim_max};
    setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_ = {};
};

class Producer {
 public:
  Producer()
      : tokens_({.max_memories = 4, .max_bytes = 64 << 10, .max_memories_total = 6},
                *local::Doorbell::Make(), budget_) {
    registered_ = *tokens_.Register(1);
    Connect();
  }
  ~Producer() {
    connection_ = nullptr;
    close(socket_);
    EXPECT_THAT_HOLDS(registered_.memory->memories() == 0, "memory outlives its connection");
    kept_.clear();
    EXPECT_THAT_HOLDS(budget_->used_bytes() == 0, budget_->used_bytes(), " bytes are nobody's");
  }

  void Run(Script script) {
    for (int i = 0; i < MostSteps(64) && !script.done(); ++i) Step(script);
  }

 private:
  void Connect() {
    if (socket_ >= 0) close(socket_);
    int ends[2];
    EXPECT_THAT_HOLDS(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends) ==
                      0);
    socket_ = ends[0];
    const int least = 1;  // room for few answers
    setsockopt(ends[1], SOL_SOCKET, SO_SNDBUF, &least, sizeof(least));
    connection_ = std::make_unique<local::Connection>(Descriptor(ends[1]), 0, &Log());
  }

  void Step(Script& script) {
    const uint8_t what = script.Byte() % 8;
    std::string packet;
    v1::LocalMessage message;
    std::vector<int> descriptors;
    if (what == 0) {
      message.mutable_hello()->set_token(registered_.token);
      packet = message.SerializeAsString();
    } else if (what <= 3) {
      const uint64_t size = what == 3 ? script.Number(8) : script.Below(65536);
      message.mutable_memory()->set_id(script.Byte() % 8);
      message.mutable_memory()->set_size(size);
      packet = message.SerializeAsString();
      const int memory = memfd_create("fuzz", MFD_CLOEXEC | MFD_ALLOW_SEALING);
      const uint8_t seals = script.Byte();
      const uint64_t real =
          (seals & 0x80) != 0 ? script.Below(65536) : std::min<uint64_t>(size, 65536);
      EXPECT_THAT_HOLDS(ftruncate(memory, static_cast<off_t>(real)) == 0);
      fcntl(memory, F_ADD_SEALS,
            (seals & 0x40) != 0 ? seals & 0x1F : F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE);
      descriptors.push_back(memory);
    } else if (what == 4) {
      message.mutable_release()->set_id(script.Byte() % 8);
      packet = message.SerializeAsString();
    } else if (what == 5) {  // not a memfd
      message.mutable_memory()->set_id(script.Byte() % 8);
      message.mutable_memory()->set_size(script.Byte());
      packet = message.SerializeAsString();
      for (int i = script.Byte() % 4; i > 0; --i) descriptors.push_back(dup(socket_));
    } else if (what == 6) {
      packet = script.Text();
      for (int i = script.Byte() % 3; i > 0; --i) descriptors.push_back(dup(socket_));
    } else {
      Happen(script);
      return Look();
    }
    Send(packet, descriptors);
    for (const int descriptor : descriptors) close(descriptor);
    std::optional<NoDescriptors> scarce;
    if (std::exchange(scarce_, false)) scarce.emplace();
    const bool open = connection_->Serve(tokens_);
    scarce.reset();
    ReadAnswer(packet);
    if (!open) Connect();
    Look();
  }

  // Sends something that is not a packet.
  void Happen(Script& script) {
    const uint8_t choice = script.Byte();
    if (choice < 0x40) {
      tokens_.Unregister(registered_.token);
      registered_ = *tokens_.Register(1);
    } else if (choice < 0x60) {
      scarce_ = true;
    } else if (choice < 0x70) {
      connection_->Refuse("there is no more room");
      ReadAnswer("packet");
      Connect();
    } else if (choice < 0x80) {  // it receives no answer
      v1::LocalMessage message;
      message.mutable_release()->set_id(99);
      Send(message.SerializeAsString(), {});
      close(std::exchange(socket_, -1));
      EXPECT_THAT_HOLDS(!connection_->Serve(tokens_), "nobody is there, and it goes on");
      Connect();
    } else if (choice < 0xA0) {  // without a packet
      EXPECT_THAT_HOLDS(connection_->Serve(tokens_) && !connection_->wants_to_write());
    } else if (choice < 0xC0) {
      PileUp(script.Byte());
    } else if (choice < 0xE0) {  // another thread reads it for longer than it is held
      auto range = registered_.memory->Find(choice % 8u, 0, 1);
      if (range.ok() && kept_.size() < 4) kept_.push_back(*std::move(range));
    } else {
      kept_.clear();
    }
  }

  // Sends packets whose answers are left unread until the server cannot send any longer; then reads
  // the answers.
  void PileUp(int packets) {
    if (connection_->memory() == nullptr) return;
    v1::LocalMessage message;
    message.mutable_release()->set_id(99);
    const std::string packet = message.SerializeAsString();
    int sent = 0, answers = 0;
    for (; sent < packets && !connection_->wants_to_write(); ++sent) {
      Send(packet, {});
      EXPECT_THAT_HOLDS(connection_->Serve(tokens_));
    }
    for (int i = 0; connection_->wants_to_write() && i <= packets; ++i) {
      EXPECT_THAT_HOLDS(ReadAnswer(packet, false));
      ++answers;
      EXPECT_THAT_HOLDS(connection_->Serve(tokens_));
    }
    while (ReadAnswer(packet, false)) ++answers;
    EXPECT_THAT_HOLDS(answers == sent, answers, " answers to ", sent, " packets");
  }

  void Send(const std::string& packet, const std::vector<int>& descriptors) {
    iovec part = {const_cast<char*>(packet.data()), packet.size()};
    msghdr out = {};
    out.msg_iov = &part;
    out.msg_iovlen = 1;
    alignas(cmsghdr) char control[CMSG_SPACE(4 * sizeof(int))] = {};
    if (!descriptors.empty()) {
      out.msg_control = control;
      out.msg_controllen = CMSG_SPACE(descriptors.size() * sizeof(int));
      cmsghdr* rights = CMSG_FIRSTHDR(&out);
      rights->cmsg_level = SOL_SOCKET;
      rights->cmsg_type = SCM_RIGHTS;
      rights->cmsg_len = CMSG_LEN(descriptors.size() * sizeof(int));
      std::memcpy(CMSG_DATA(rights), descriptors.data(), descriptors.size() * sizeof(int));
    }
    EXPECT_THAT_HOLDS(sendmsg(socket_, &out, MSG_NOSIGNAL) >= 0);
  }

  void ReadAnswer(const std::string& packet) {
    const bool answered = ReadAnswer(packet, true);
    EXPECT_THAT_HOLDS(answered || packet.empty(), "a packet has no answer");
  }

  // `last`: no other answer follows. Returns false if there was no answer.
  bool ReadAnswer(const std::string& packet, bool last) {
    char bytes[8192];
    const ssize_t got = recv(socket_, bytes, sizeof(bytes), 0);
    if (packet.empty() || got <= 0) return false;  // an empty packet is the end
    v1::LocalAnswer answer;
    EXPECT_THAT_HOLDS(answer.ParseFromArray(bytes, static_cast<int>(got)));
    EXPECT_THAT_HOLDS(answer.what_case() != v1::LocalAnswer::WHAT_NOT_SET);
    CountExchange(ExchangeKind::kLocal, !answer.has_refused());
    if (answer.has_refused()) {
      ExpectSays(absl::InvalidArgumentError(answer.refused().message()));
      EXPECT_THAT_HOLDS(!answer.refused().message().empty());
    }
    if (last) {
      EXPECT_THAT_HOLDS(recv(socket_, bytes, sizeof(bytes), 0) <= 0, "a packet has two answers");
    }
    return true;
  }

  void Look() {
    const local::LocalMemory& memory = *registered_.memory;
    EXPECT_THAT_HOLDS(memory.memories() <= 4 && memory.bytes() <= 64 << 10 && !memory.ended());
    for (uint64_t id = 0; id < 8; ++id) {
      for (const uint64_t offset : {uint64_t{0}, uint64_t{100}, UINT64_MAX}) {
        const auto range = memory.Find(id, offset, 16);
        if (!range.ok()) {
          ExpectSays(range.status());
          continue;
        }
        EXPECT_THAT_HOLDS(range->bytes.size() == 16);
        for (const char c : range->bytes) EXPECT_THAT_HOLDS(c == 0);
      }
    }
  }

  const std::shared_ptr<Budget> budget_ = std::make_shared<Budget>(60 << 10);
  local::Tokens tokens_;
  local::Tokens::Registered registered_;
  std::vector<wire::MappedRange> kept_;
  bool scarce_ = false;  // no descriptor is left when the next packet arrives
  int socket_ = -1;
  std::unique_ptr<local::Connection> connection_;
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Producer().Run(voxeld::fuzz::Script(data, size));
  return 0;
}
