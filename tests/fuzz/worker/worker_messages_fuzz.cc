// An engine's worker, and a malicious or broken owner: a sequence of messages, over a real socket,
// with real segments. Each call has one answer, under its own number; no descriptor leaks, and
// memory that was pinned for a device is unpinned while it exists.

#include <dirent.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_join.h"
#include "display/crc/crc32c.h"
#include "gpu/bulk/segment.h"
#include "gpu/cpu/cpu_engine.h"
#include "gpu/worker/message.h"
#include "gpu/worker/target_codec.h"
#include "gpu/worker/worker_connection.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"
#include "tests/fuzz/worker/open_descriptors.h"
#include "tests/fuzz/worker/small_target.h"
#include "tests/fuzz/worker/sound_delta.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::gpu;  // NOLINT(google-build-using-namespace)

constexpr int kMostMessages = 64;
constexpr size_t kSegmentBytes = 16 << 10;

bool IsSmall(const Target& target) {
  const auto& grid = target.geometry.grid;
  const int64_t most = 64;
  return grid.nx <= most && grid.ny <= most && grid.nz <= most && target.layout.width <= most &&
         target.layout.height <= most && target.layout.slices <= most &&
         target.layout.sub_frames <= 4;
}

// An engine that is linked with other ranks.
class LinkedEngine final : public Engine, public RankLink {
 public:
  explicit LinkedEngine(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}

  const EngineInfo& info() const override { return engine_->info(); }
  void SetTarget(Target target, Done done) override {
    engine_->SetTarget(std::move(target), std::move(done));
  }
  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    return engine_->AcquireStaging(size);
  }
  void Apply(StagingBlock block, size_t size, Done done) override {
    engine_->Apply(std::move(block), size, std::move(done));
  }
  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    engine_->SubmitFrame(request, buffer, std::move(done));
  }
  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    engine_->ReadVoxels(box, out, std::move(done));
  }
  RankLink* link() override { return this; }

  absl::StatusOr<Invitation> Invite(const std::string& library) override {
    if (library.size() != 1) return absl::FailedPreconditionError("no such library");
    Invitation invitation;
    invitation.fill(static_cast<std::byte>(library[0]));
    return invitation;
  }
  absl::Status Join(const std::string& library, const Invitation& invitation, int rank,
                    int ranks) override {
    const auto mine = Invite(library);
    if (!mine.ok()) return mine.status();
    if (*mine != invitation || rank < 0 || rank >= ranks) {
      return absl::DataLossError("the ranks are not each other's");
    }
    return absl::OkStatus();
  }

 private:
  const std::unique_ptr<Engine> engine_;
};

class Owner {
 public:
  Owner() {
    hooks_.make_engine =
        [](const EngineOptions& options) -> absl::StatusOr<std::unique_ptr<Engine>> {
      if (options.kind != EngineKind::kCpu) return absl::FailedPreconditionError("no such engine");
      EngineOptions own = options;
      own.threads = 1;
      auto engine = CreateCpuEngine(own, "");
      if (options.device == 0) return engine;
      return std::make_unique<LinkedEngine>(std::move(engine));
    };
    hooks_.pin = hooks_.pin_read_only = [this](std::span<std::byte> memory) {
      EXPECT_THAT_HOLDS(!memory.empty() && pinned_.emplace(memory.data(), memory.size()).second,
                        "pinned twice");
    };
    hooks_.unpin = [this](std::span<std::byte> memory) {
      const auto it = pinned_.find(memory.data());
      EXPECT_THAT_HOLDS(it != pinned_.end() && it->second == memory.size(), "was never pinned");
      const volatile std::byte* const there = memory.data();
      (void)*there;  // it is still mapped
      pinned_.erase(it);
    };
    EXPECT_THAT_HOLDS(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends_) == 0);
    fcntl(ends_[0], F_SETFL, O_NONBLOCK);
    const int least = 1;  // room for few messages
    setsockopt(ends_[0], SOL_SOCKET, SO_SNDBUF, &least, sizeof(least));
    worker_ = NewWorkerConnection(ends_[1], hooks_);
  }
  ~Owner() {
    worker_ = nullptr;
    EXPECT_THAT_HOLDS(pinned_.empty(), pinned_.size(), " stay pinned");
    if (ends_[0] >= 0) close(ends_[0]);
    close(ends_[1]);
  }

  void Run(Script script) {
    for (int i = 0; i < kMostMessages && !script.done(); ++i) {
      if (!Step(script)) return;
    }
  }

 private:
  // Returns false if the worker has exited.
  bool Step(Script& script) {
    switch (script.Byte() % 11) {
      case 0: {
        OpenMessage open;
        const uint8_t choice = script.Byte();
        if (choice == 1) open.protocol = script.Byte();
        if (choice == 2) open.kind = static_cast<EngineKind>(script.Byte() % 3);
        open.device = choice >> 6 & 1;
        if (choice >= 3) {
          open.part = {.begin = static_cast<int8_t>(script.Byte()),
                       .end = static_cast<int8_t>(script.Byte()),
                       .rank = static_cast<int8_t>(script.Byte()),
                       .ranks = static_cast<int8_t>(script.Byte())};
        }
        open.index_bytes = script.Number(2);
        return Send(MakeMessage(MessageType::kOpen, ++call_, open), true);
      }
      case 1:
        return TellSegment(script, false);
      case 2: {
        const SegmentMessage named{.segment = script.Byte() % 4u, .staging = script.Byte()};
        segments_.erase(named.segment);
        return Send(MakeMessage(MessageType::kDropSegment, 0, named), false);
      }
      case 3: {
        std::vector<std::byte> target = EncodeTarget(SmallTarget(script));
        if (script.Flag()) {
          const size_t at = script.Below(65536) % target.size();
          target[at] = static_cast<std::byte>(script.Byte());
        }
        const auto decoded = DecodeTarget(target);
        if (decoded.ok() && !IsSmall(*decoded)) return true;
        if (decoded.ok()) EXPECT_THAT_HOLDS(EncodeTarget(*decoded).size() <= target.size());
        return Bulk(script, MessageType::kTarget, target);
      }
      case 4:
        return Bulk(script, MessageType::kApply, SoundDelta(script));
      case 5: {
        const std::string text = script.Text();
        const auto* const data = reinterpret_cast<const std::byte*>(text.data());
        return Bulk(script, MessageType::kApply, {data, data + text.size()});
      }
      case 6: {
        FrameMessage frame;
        frame.segment = script.Byte() % 4u;
        frame.frame = script.Byte();
        frame.holds = script.Byte();
        frame.buffer_holds = script.Byte();
        const uint8_t choice = script.Byte();
        frame.pictures = choice == 0 ? script.Number(8) : 4u * (1 + choice % 2);
        frame.bytes = choice == 1 ? script.Number(8) : script.Number(2);
        return Send(MakeMessage(MessageType::kFrame, ++call_, frame), true);
      }
      case 7: {
        VoxelsMessage voxels;
        voxels.segment = script.Byte() % 4u;
        voxels.box = {static_cast<int8_t>(script.Byte()), static_cast<int8_t>(script.Byte()),
                      static_cast<int8_t>(script.Byte()), static_cast<int8_t>(script.Byte()),
                      static_cast<int8_t>(script.Byte()), static_cast<int8_t>(script.Byte())};
        voxels.count = script.Flag() ? script.Number(8) : script.Byte();
        return Send(MakeMessage(MessageType::kVoxels, ++call_, voxels), true);
      }
      case 8:
        return TellSegment(script, true);
      case 9: {
        const BulkSegmentMessage named{.segment = script.Byte() % 4u, .size = 0};
        return Send(MakeMessage(MessageType::kDropBulkSegment, 0, named), false);
      }
      default: {  // any message, with a descriptor or without; or what is not a message
        Message message;
        message.type = static_cast<MessageType>(script.Byte());
        message.call = script.Byte();
        const std::string text = script.Text();
        const auto* const data = reinterpret_cast<const std::byte*>(text.data());
        message.body.assign(data, data + std::min<size_t>(text.size(), 4096));
        const uint8_t how = script.Byte();
        if ((how & 1) != 0) message.fd = ends_[0];
        if ((how & 2) != 0) return SendNone(std::move(message), text);
        if ((how & 4) != 0) return Leave(message);
        if ((how & 8) != 0) return SendMany(message);
        return Send(std::move(message), {});
      }
    }
  }

  // Sends something too long, or too short, to be a message. A worker exits on it, as at the end of
  // the connection.
  bool SendNone(Message message, const std::string& text) {
    if (text.empty()) {
      message.body.resize(4097);
      EXPECT_THAT_HOLDS(SendMessage(ends_[0], message).ok());
    } else {
      EXPECT_THAT_HOLDS(send(ends_[0], text.data(), std::min<size_t>(text.size(), 15), 0) >= 0);
    }
    const absl::StatusOr<Message> received = ReceiveMessage(ends_[1]);
    EXPECT_THAT_HOLDS(absl::IsUnavailable(received.status()), "what is no message passes for one");
    return false;
  }

  // Disconnects before the answer.
  bool Leave(const Message& message) {
    EXPECT_THAT_HOLDS(SendMessage(ends_[0], message).ok());
    close(std::exchange(ends_[0], -1));
    absl::StatusOr<Message> received = ReceiveMessage(ends_[1]);
    EXPECT_THAT_HOLDS(received.ok());
    ExpectSays(worker_->Handle(*received));
    EXPECT_THAT_HOLDS(received->fd < 0, "a descriptor is left");
    return false;
  }

  // Sends the same until it has no room left.
  bool SendMany(const Message& message) {
    int sent = 0;
    absl::Status status;
    while (sent < 1000 && (status = SendMessage(ends_[0], message)).ok()) ++sent;
    EXPECT_THAT_HOLDS(absl::IsResourceExhausted(status), status.ToString());
    bool goes_on = true;
    for (; sent > 0; --sent) {
      absl::StatusOr<Message> received = ReceiveMessage(ends_[1]);
      EXPECT_THAT_HOLDS(received.ok() && received->body == message.body);
      if (goes_on) goes_on = worker_->Handle(*received).ok();
      if (received->fd >= 0) close(received->fd);
      (void)ReceiveMessage(ends_[0]);
    }
    return goes_on;
  }

  bool TellSegment(Script& script, bool bulk) {
    const uint32_t id = script.Byte() % 4u;
    const uint8_t choice = script.Byte();
    const auto made =
        bulk ? Segment::CreateReadOnlyForOthers(kSegmentBytes) : Segment::Create(kSegmentBytes);
    EXPECT_THAT_HOLDS(made.ok(), made.status().ToString());
    const std::string text = script.Text();
    std::memcpy((*made)->bytes().data(), text.data(), std::min(text.size(), kSegmentBytes));
    const uint64_t size = choice == 1 ? script.Number(8) : kSegmentBytes;
    Message message =
        bulk ? MakeMessage(MessageType::kBulkSegment, 0, BulkSegmentMessage{id, size})
             : MakeMessage(MessageType::kSegment, 0, SegmentMessage{id, choice % 2u, size});
    if (choice != 2) message.fd = (*made)->fd();
    if (!bulk) segments_[id] = *made;
    return Send(message, false);
  }

  // Puts bytes in a segment, and sends a message with their checksum.
  bool Bulk(Script& script, MessageType type, const std::vector<std::byte>& bytes) {
    const uint32_t id = script.Byte() % 4u;
    const auto it = segments_.find(id);
    const size_t size = std::min(bytes.size(), kSegmentBytes);
    if (it != segments_.end()) std::copy_n(bytes.begin(), size, it->second->bytes().begin());
    BulkMessage message{
        .segment = id, .crc = display::Crc32c(std::span(bytes).first(size)), .size = size};
    const uint8_t choice = script.Byte();
    if (choice == 1) message.crc ^= 1;
    if (choice == 2) message.size = script.Number(8);
    return Send(MakeMessage(type, ++call_, message), true);
  }

  // `answered`: whether it is a call; nullopt: unknown.
  bool Send(const Message& message, std::optional<bool> answered) {
    EXPECT_THAT_HOLDS(SendMessage(ends_[0], message).ok());
    absl::StatusOr<Message> received = ReceiveMessage(ends_[1]);
    EXPECT_THAT_HOLDS(received.ok(), received.status().ToString());
    EXPECT_THAT_HOLDS(received->type == message.type && received->call == message.call &&
                      received->body == message.body);
    const absl::Status status = worker_->Handle(*received);
    EXPECT_THAT_HOLDS(received->fd < 0, "a descriptor is left");
    ExpectSays(status);
    const absl::StatusOr<Message> answer = ReceiveMessage(ends_[0]);
    if (answered.has_value()) {
      EXPECT_THAT_HOLDS(*answered ? answer.ok() || !status.ok() : !answer.ok());
    }
    if (answer.ok()) {
      EXPECT_THAT_HOLDS(answer->call == message.call && answer->fd < 0);
      EXPECT_THAT_HOLDS(!ReceiveMessage(ends_[0]).ok(), "a call has two answers");
      if (answer->type == MessageType::kDone) {
        const absl::Status done = StatusOf(*answer);
        ExpectSays(done);
        EXPECT_THAT_HOLDS(!absl::IsDataLoss(done) || absl::IsDataLoss(status));
      }
    }
    return status.ok();
  }

  WorkerHooks hooks_;
  int ends_[2] = {-1, -1};
  std::unique_ptr<WorkerConnection> worker_;
  std::map<uint32_t, std::shared_ptr<Segment>> segments_;
  std::map<const std::byte*, size_t> pinned_;
  uint64_t call_ = 0;
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  // The first engine opens descriptors that stay open.
  static const bool begun = [] {
    constexpr uint8_t kOpen[] = {0, 0, 0, 0};
    voxeld::fuzz::Owner().Run(voxeld::fuzz::Script(kOpen, sizeof(kOpen)));
    return true;
  }();
  EXPECT_THAT_HOLDS(begun);
  const auto before = voxeld::fuzz::OpenDescriptors();
  voxeld::fuzz::Owner().Run(voxeld::fuzz::Script(data, size));
  const auto after = voxeld::fuzz::OpenDescriptors();
  EXPECT_THAT_HOLDS(after.size() == before.size(), "of ", before.size(), " descriptors there are ",
                    after.size(), "; ", absl::StrJoin(after, ", "));
  return 0;
}
