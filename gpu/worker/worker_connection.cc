#include "gpu/worker/worker_connection.h"

#include <unistd.h>

#include <cstring>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/crc/crc32c.h"
#include "gpu/bulk/segment.h"
#include "gpu/cpu/executor.h"
#include "gpu/worker/frame_slot.h"
#include "gpu/worker/target_codec.h"

namespace voxeld::gpu {
namespace {

// A block of staging memory in a segment.
class SegmentMemory final : public StagingBlock::Memory {
 public:
  SegmentMemory(std::shared_ptr<Segment> segment, BulkSource* bulk)
      : segment_(std::move(segment)), bulk_(bulk) {}
  std::span<std::byte> bytes() override { return segment_->bytes(); }
  BulkSource* bulk() override { return bulk_; }

 private:
  const std::shared_ptr<Segment> segment_;
  BulkSource* const bulk_;
};

// The bulk memory that the owner has shown. The owner keeps the bytes of each piece unchanged.
class BulkSegments final : public BulkSource {
 public:
  absl::StatusOr<BulkView> Find(const BulkRef& ref) override {
    const auto it = segments.find(ref.segment);
    if (it == segments.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("bulk memory: segment ", ref.segment, " is not known"));
    }
    const size_t has = it->second->bytes().size();
    if (ref.offset > has || ref.size > has - ref.offset) {
      return absl::InvalidArgumentError(absl::StrCat("bulk memory: ", ref.size, " bytes at byte ",
                                                     ref.offset, " of segment ", ref.segment,
                                                     ", which has ", has));
    }
    return BulkView{it->second->bytes().subspan(ref.offset, ref.size), it->second};
  }

  std::map<uint64_t, std::shared_ptr<Segment>> segments;
};

class Connection final : public WorkerConnection {
 public:
  Connection(int socket, const WorkerHooks& hooks) : socket_(socket), hooks_(hooks) {}
  ~Connection() override {
    engine_ = nullptr;
    if (!hooks_.unpin) return;
    for (const auto& [id, mapped] : segments_) Unpin(mapped);
    for (const auto& [id, segment] : bulk_.segments) hooks_.unpin(segment->bytes());
  }

  absl::Status Handle(Message& message) override {
    const absl::Status status = Carry(message);
    // Close a descriptor that the message's handler did not take.
    if (message.fd >= 0) close(std::exchange(message.fd, -1));
    return status;
  }

 private:
  absl::Status Carry(Message& message) {
    switch (message.type) {
      case MessageType::kOpen:
        return Open(message);
      case MessageType::kSegment:
        return TakeSegment(message);
      case MessageType::kDropSegment:
        return DropSegment(message);
      case MessageType::kBulkSegment:
        return TakeBulkSegment(message);
      case MessageType::kDropBulkSegment:
        return DropBulkSegment(message);
      case MessageType::kTarget:
      case MessageType::kApply:
      case MessageType::kFrame:
      case MessageType::kVoxels:
      case MessageType::kInvite:
      case MessageType::kJoin:
        break;
      default:
        return absl::InvalidArgumentError("a message of an unknown type");
    }
    if (engine_ == nullptr) return absl::InvalidArgumentError("a call before kOpen");
    switch (message.type) {
      case MessageType::kTarget:
        return SetTarget(message);
      case MessageType::kApply:
        return Apply(message);
      case MessageType::kFrame:
        return Frame(message);
      case MessageType::kInvite:
        return Invite(message);
      case MessageType::kJoin:
        return Join(message);
      default:
        return Voxels(message);
    }
  }

  absl::Status Answer(uint64_t call, const absl::Status& status) {
    const absl::Status sent = SendMessage(socket_, MakeDone(call, status));
    return absl::IsDataLoss(status) ? status : sent;
  }

  absl::Status Open(const Message& message) {
    const auto open = message.As<OpenMessage>();
    if (!open.has_value() || open->protocol != kWorkerProtocol) {
      return Answer(message.call,
                    absl::FailedPreconditionError("the worker is of another build than its owner"));
    }
    EngineOptions options;
    options.kind = open->kind;
    options.threads = open->threads;
    options.device = open->device;
    options.part = open->part;
    options.index_bytes = open->index_bytes;
    options.cpu_index_bytes = open->cpu_index_bytes;
    options.inline_execution = true;
    absl::StatusOr<std::unique_ptr<Engine>> engine = hooks_.make_engine(options);
    if (!engine.ok()) return Answer(message.call, engine.status());
    engine_ = *std::move(engine);
    part_ = open->part;
    layout_.reset();  // it has no target yet
    ReadyMessage ready;
    ready.kind = engine_->info().kind;
    std::strncpy(ready.device, engine_->info().device.c_str(), sizeof(ready.device) - 1);
    return SendMessage(socket_, MakeMessage(MessageType::kReady, message.call, ready));
  }

  absl::Status TakeSegment(Message& message) {
    const auto named = message.As<SegmentMessage>();
    if (!named.has_value() || message.fd < 0) {
      return absl::InvalidArgumentError("a segment without memory");
    }
    absl::StatusOr<std::shared_ptr<Segment>> segment =
        Segment::Adopt(std::exchange(message.fd, -1), named->size);
    if (!segment.ok()) return absl::InvalidArgumentError(segment.status().message());
    Mapped& mapped = segments_[named->segment];
    Unpin(mapped);  // of an earlier segment with that number
    mapped.pinned = {};
    mapped.segment = *std::move(segment);
    if (named->staging != 0) Pin(mapped, mapped.segment->bytes());
    return absl::OkStatus();
  }

  absl::Status DropSegment(const Message& message) {
    const auto named = message.As<SegmentMessage>();
    const auto it = named.has_value() ? segments_.find(named->segment) : segments_.end();
    if (it == segments_.end()) return absl::InvalidArgumentError("an unknown segment is dropped");
    Unpin(it->second);
    segments_.erase(it);
    return absl::OkStatus();
  }

  absl::Status TakeBulkSegment(Message& message) {
    const auto named = message.As<BulkSegmentMessage>();
    if (!named.has_value() || message.fd < 0) {
      return absl::InvalidArgumentError("a segment without memory");
    }
    absl::StatusOr<std::shared_ptr<Segment>> segment =
        Segment::AdoptReadOnly(std::exchange(message.fd, -1), named->size);
    if (!segment.ok()) return absl::InvalidArgumentError(segment.status().message());
    std::shared_ptr<Segment>& kept = bulk_.segments[named->segment];
    if (kept != nullptr && hooks_.unpin) hooks_.unpin(kept->bytes());
    kept = *std::move(segment);
    if (hooks_.pin_read_only) hooks_.pin_read_only(kept->bytes());
    return absl::OkStatus();
  }

  absl::Status DropBulkSegment(const Message& message) {
    const auto named = message.As<BulkSegmentMessage>();
    const auto it = named.has_value() ? bulk_.segments.find(named->segment) : bulk_.segments.end();
    if (it == bulk_.segments.end()) {
      return absl::InvalidArgumentError("an unknown segment of bulk memory is dropped");
    }
    if (hooks_.unpin) hooks_.unpin(it->second->bytes());
    bulk_.segments.erase(it);
    return absl::OkStatus();
  }

  std::shared_ptr<Segment> Find(uint32_t id, uint64_t size) const {
    const auto it = segments_.find(id);
    if (it == segments_.end() || it->second.segment->bytes().size() < size) return nullptr;
    return it->second.segment;
  }

  // A segment, and the part of it that a device copies to and from.
  struct Mapped {
    std::shared_ptr<Segment> segment;
    std::span<std::byte> pinned;
  };
  void Pin(Mapped& mapped, std::span<std::byte> memory) const {
    if (!hooks_.pin ||
        (mapped.pinned.data() == memory.data() && mapped.pinned.size() == memory.size())) {
      return;
    }
    Unpin(mapped);
    mapped.pinned = memory;
    if (!memory.empty()) hooks_.pin(memory);
  }
  void Unpin(const Mapped& mapped) const {
    if (hooks_.unpin && !mapped.pinned.empty()) hooks_.unpin(mapped.pinned);
  }

  // Returns the segment of a bulk message, if its bytes are as they were sent.
  absl::StatusOr<std::shared_ptr<Segment>> Bulk(const BulkMessage& bulk) const {
    std::shared_ptr<Segment> segment = Find(bulk.segment, bulk.size);
    if (segment == nullptr) return absl::InvalidArgumentError("bulk data in an unknown segment");
    if (display::Crc32c(segment->bytes().first(bulk.size)) != bulk.crc) {
      return absl::DataLossError("bulk data was damaged on its way to the worker");
    }
    return segment;
  }

  absl::Status SetTarget(const Message& message) {
    const auto bulk = message.As<BulkMessage>();
    if (!bulk.has_value()) return absl::InvalidArgumentError("kTarget is too short");
    const absl::StatusOr<std::shared_ptr<Segment>> segment = Bulk(*bulk);
    if (!segment.ok()) return Answer(message.call, segment.status());
    absl::StatusOr<Target> target = DecodeTarget((*segment)->bytes().first(bulk->size));
    if (!target.ok()) return Answer(message.call, target.status());
    const display::FrameLayout layout = target->layout;
    absl::Status status;
    engine_->SetTarget(*std::move(target), [&](const absl::Status& done) { status = done; });
    if (status.ok()) {
      layout_ = layout;
      executor_ = MakeFrameExecutor(layout.bytes());
    }
    return Answer(message.call, status);
  }

  absl::Status Apply(const Message& message) {
    const auto bulk = message.As<BulkMessage>();
    if (!bulk.has_value()) return absl::InvalidArgumentError("kApply is too short");
    absl::StatusOr<std::shared_ptr<Segment>> segment = Bulk(*bulk);
    if (!segment.ok()) return Answer(message.call, segment.status());
    absl::Status status;
    engine_->Apply(StagingBlock(std::make_shared<SegmentMemory>(*std::move(segment), &bulk_)),
                   bulk->size, [&](const absl::Status& done) { status = done; });
    return Answer(message.call, status);
  }

  absl::Status Frame(const Message& message) {
    const auto frame = message.As<FrameMessage>();
    if (!frame.has_value()) return absl::InvalidArgumentError("kFrame is too short");
    if (frame->buffer_holds >= frame->frame) {
      return Answer(message.call, absl::InvalidArgumentError(
                                      absl::StrCat("frame: buffer_holds is ", frame->buffer_holds,
                                                   ", must be less than ", frame->frame)));
    }
    constexpr uint64_t kMost = uint64_t{1} << 48;  // sums do not overflow
    const FrameSlot slot{frame->pictures, frame->bytes};
    const std::shared_ptr<Segment> segment =
        slot.pictures < kMost && slot.bytes < kMost ? Find(frame->segment, slot.size()) : nullptr;
    if (segment == nullptr) return absl::InvalidArgumentError("a frame for an unknown segment");
    const FrameBuffer buffer = slot.In(segment->bytes());
    const bool fits = layout_.has_value() && slot.pictures == layout_->pictures() &&
                      slot.bytes == layout_->bytes();
    const PictureRange mine =
        fits ? PictureRange::Of(*layout_, part_.Within(layout_->slices)) : PictureRange();
    if (fits) Pin(segments_[frame->segment], BytesOf(*layout_, buffer, mine));
    absl::StatusOr<FrameResult> result = absl::InternalError("no answer");
    engine_->SubmitFrame({frame->frame, frame->holds}, buffer,
                         [&](const absl::StatusOr<FrameResult>& done) { result = done; });
    if (!result.ok()) return Answer(message.call, result.status());
    const FrameDoneMessage done{*result,
                                FrameCrc(*layout_, buffer, mine, frame->holds, *executor_)};
    return SendMessage(socket_, MakeMessage(MessageType::kFrameDone, message.call, done));
  }

  absl::Status Invite(const Message& message) {
    if (engine_->link() == nullptr) return Answer(message.call, NoLink());
    const absl::StatusOr<RankLink::Invitation> invitation =
        engine_->link()->Invite(message.TextAfter<InviteMessage>());
    if (!invitation.ok()) return Answer(message.call, invitation.status());
    return SendMessage(
        socket_, MakeMessage(MessageType::kInvited, message.call, InvitedMessage{*invitation}));
  }

  absl::Status Join(const Message& message) {
    const auto join = message.As<JoinMessage>();
    if (!join.has_value()) return absl::InvalidArgumentError("kJoin is too short");
    if (engine_->link() == nullptr) return Answer(message.call, NoLink());
    return Answer(message.call, engine_->link()->Join(message.TextAfter<JoinMessage>(),
                                                      join->invitation, join->rank, join->ranks));
  }

  static absl::Status NoLink() {
    return absl::FailedPreconditionError("such an engine is not linked with others");
  }

  absl::Status Voxels(const Message& message) {
    const auto voxels = message.As<VoxelsMessage>();
    if (!voxels.has_value()) return absl::InvalidArgumentError("kVoxels is too short");
    const std::shared_ptr<Segment> segment =
        voxels->count <= UINT64_MAX / sizeof(uint32_t)
            ? Find(voxels->segment, voxels->count * sizeof(uint32_t))
            : nullptr;
    if (segment == nullptr) return absl::InvalidArgumentError("voxels for an unknown segment");
    const std::span<uint32_t> out(reinterpret_cast<uint32_t*>(segment->bytes().data()),
                                  voxels->count);
    absl::Status status;
    engine_->ReadVoxels(voxels->box, out, [&](const absl::Status& done) { status = done; });
    return Answer(message.call, status);
  }

  const int socket_;
  const WorkerHooks& hooks_;
  std::unique_ptr<Engine> engine_;
  SlicePart part_;
  std::map<uint32_t, Mapped> segments_;
  std::unique_ptr<Executor> executor_;  // checks frames
  BulkSegments bulk_;
  std::optional<display::FrameLayout> layout_;
};

}  // namespace

std::unique_ptr<WorkerConnection> NewWorkerConnection(int socket, const WorkerHooks& hooks) {
  return std::make_unique<Connection>(socket, hooks);
}

}  // namespace voxeld::gpu
