#include "gpu/worker/worker_engine.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <exception>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "display/crc/crc32c.h"
#include "display/sync/mutex.h"
#include "gpu/checks.h"
#include "gpu/worker/await.h"
#include "gpu/worker/bulk_ledger.h"
#include "gpu/worker/call_channel.h"
#include "gpu/worker/frame_slot.h"
#include "gpu/worker/process.h"
#include "gpu/worker/segment_pool.h"
#include "gpu/worker/target_codec.h"
#include "gpu/worker/worker_pool.h"

namespace voxeld::gpu {
namespace {

// The first answer comes when the CUDA context exists, which can take seconds.
constexpr int64_t kFirstAnswerFactor = 10;
// The time that a byte sent with a call may take: it is checked and copied twice, on a slow host.
constexpr int64_t kNsPerByte = 4;

// Converts an answer that is only a status.
absl::Status PlainStatus(const absl::StatusOr<Message>& answer) {
  if (!answer.ok()) return answer.status();
  if (answer->type != MessageType::kDone) return absl::DataLossError("an answer of another type");
  return StatusOf(*answer);
}

absl::StatusOr<RankLink::Invitation> InvitationOf(const absl::StatusOr<Message>& answer) {
  if (!answer.ok()) return answer.status();
  const auto invited = answer->As<InvitedMessage>();
  if (answer->type == MessageType::kInvited && invited) return invited->invitation;
  const absl::Status status = PlainStatus(answer);
  return status.ok() ? absl::DataLossError("the worker's invitation is none") : status;
}

// Names the first `size` bytes of a segment; their CRC is computed when the message is sent.
std::function<void(Message&)> NameBulk(SegmentPool::Lease lease, size_t size) {
  return [lease = std::move(lease), size](Message& message) {
    const uint32_t crc = display::Crc32c(lease->segment->bytes().first(size));
    message.body = MakeMessage(message.type, 0, BulkMessage{lease->id, crc, size}).body;
  };
}

class WorkerEngine final : public RankWorker {
 public:
  WorkerEngine(const EngineOptions& options, std::string reason,
               std::shared_ptr<WorkerStaging> staging, std::shared_ptr<CallChannel> channel)
      : options_(options),
        channel_(std::move(channel)),
        staging_(std::move(staging)),
        results_(UINT64_MAX, staging_->ids(), SegmentNews::Added(news_, false),
                 SegmentNews::Dropped(news_)) {
    staging_->AddListener(channel_);
    news_->AddListener(channel_);
    info_.kind = options.kind;
    info_.reason = std::move(reason);
  }

  ~WorkerEngine() override { channel_->Close(); }

  // Requests the engine; `options_.wait_until_ready` says whether to wait for the answer. If not,
  // calls `opened` (may be empty) with the result.
  absl::Status Open(std::function<void(const absl::Status&)> opened) {
    OpenMessage open;
    open.kind = options_.kind;
    open.threads = options_.threads;
    open.device = options_.device;
    open.part = options_.part;
    open.index_bytes = options_.index_bytes;
    open.cpu_index_bytes = options_.cpu_index_bytes;
    const auto ask = [&](std::function<void(absl::Status)> answered) {
      channel_->Call(MakeMessage(MessageType::kOpen, 0, open), nullptr,
                     [this, answered = std::move(answered)](const absl::StatusOr<Message>& answer) {
                       answered(OnOpened(answer));
                     });
    };
    if (options_.wait_until_ready) return Await<absl::Status>(ask);
    ask([this, opened = std::move(opened)](const absl::Status& status) {
      if (!status.ok()) channel_->Fail(absl::DataLossError(status.message()));
      if (opened) opened(status);
    });
    return absl::OkStatus();
  }

  const EngineInfo& info() const override { return info_; }

  void SetTarget(Target target, Done done) override {
    const std::vector<std::byte> bytes = EncodeTarget(target);
    absl::StatusOr<SegmentPool::Lease> lease = results_.Acquire(bytes.size());
    if (!lease.ok()) return Refuse(std::move(done), std::move(lease).status());
    std::memcpy((*lease)->segment->bytes().data(), bytes.data(), bytes.size());
    {
      sync::MutexLock lock(mutex_);
      ++target_;
      slots_.clear();  // the frames in them are of another target
    }
    Ask<absl::Status>(std::move(done), [&](auto answer) {
      channel_->Call(MakeMessage(MessageType::kTarget, 0, BulkMessage{}),
                     NameBulk(*lease, bytes.size()),
                     [this, layout = target.layout, lease = *lease,
                      answer](const absl::StatusOr<Message>& message) {
                       const absl::Status status = PlainStatus(message);
                       Judge(status);
                       if (status.ok()) {
                         sync::MutexLock lock(mutex_);
                         layout_ = layout;
                         executor_ = MakeFrameExecutor(layout.bytes());
                       }
                       answer(status);
                     });
    });
  }

  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    return staging_->Acquire(size);
  }

  void Apply(StagingBlock block, size_t size, Done done) override {
    if (auto delta = CheckDelta(block, size); !delta.ok()) {
      return Refuse(std::move(done), std::move(delta).status());
    }
    absl::StatusOr<BulkLedger::Change> change =
        BulkLedger::ChangeOf(block.bytes().first(size), block.referred());
    if (change.ok()) {
      if (absl::Status status = Show(block.referred()); !status.ok()) change = status;
    }
    if (!change.ok()) return Refuse(std::move(done), std::move(change).status());
    const auto* memory = static_cast<const LeasedMemory*>(block.memory().get());
    SegmentPool::Lease lease = memory->lease();
    block = {};
    Ask<absl::Status>(std::move(done), [&](auto answer) {
      channel_->Call(
          MakeMessage(MessageType::kApply, 0, BulkMessage{}), NameBulk(lease, size),
          [this, lease, change = *std::move(change),
           answer](const absl::StatusOr<Message>& message) mutable {
            lease = nullptr;  // released before the answer
            const absl::Status status = PlainStatus(message);
            Judge(status);
            if (status.ok()) ledger_.Apply(std::move(change), info_.kind == EngineKind::kCuda);
            change = {};
            answer(status);
          },
          static_cast<int64_t>(size) * kNsPerByte);
    });
  }

  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    absl::StatusOr<Slot> slot = TakeSlot(buffer);
    if (!slot.ok()) return Refuse(std::move(done), std::move(slot).status());
    Ask<absl::StatusOr<FrameResult>>(std::move(done), [&](auto answer) {
      const FrameMessage sent{slot->lease->id,          request.frame,
                              slot->lease->holds,       request.buffer_holds,
                              buffer.changed_in.size(), buffer.bytes.size()};
      channel_->Call(
          MakeMessage(MessageType::kFrame, 0, sent), nullptr,
          [this, request, buffer, sent, slot = *slot,
           answer](const absl::StatusOr<Message>& message) {
            absl::StatusOr<FrameResult> result = TakeFrame(message, request, buffer, sent, slot);
            Judge(result.status());
            answer(std::move(result));
          },
          static_cast<int64_t>(buffer.bytes.size()) * kNsPerByte);
    });
  }

  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    absl::StatusOr<SegmentPool::Lease> lease = results_.Acquire(out.size_bytes());
    if (!lease.ok()) return Refuse(std::move(done), std::move(lease).status());
    Ask<absl::Status>(std::move(done), [&](auto answer) {
      channel_->Call(
          MakeMessage(MessageType::kVoxels, 0, VoxelsMessage{(*lease)->id, box, out.size()}),
          nullptr, [this, lease = *lease, out, answer](const absl::StatusOr<Message>& message) {
            const absl::Status status = PlainStatus(message);
            Judge(status);
            if (status.ok()) {
              std::copy_n(lease->segment->bytes().begin(), out.size_bytes(),
                          std::as_writable_bytes(out).begin());
            }
            answer(status);
          });
    });
  }

  void Invite(const std::string& library,
              std::function<void(absl::StatusOr<RankLink::Invitation>)> done) override {
    channel_->Call(
        MakeMessage(MessageType::kInvite, 0, InviteMessage{}, library), nullptr,
        [this, done = std::move(done)](const absl::StatusOr<Message>& answer) {
          const absl::StatusOr<RankLink::Invitation> invitation = InvitationOf(answer);
          Judge(invitation.status());
          done(invitation);
        },
        options_.worker_deadline_ns * kFirstAnswerFactor);
  }

  void Join(const std::string& library, const RankLink::Invitation& invitation, int rank, int ranks,
            Done done) override {
    channel_->Call(
        MakeMessage(MessageType::kJoin, 0, JoinMessage{invitation, rank, ranks}, library), nullptr,
        [this, done = std::move(done)](const absl::StatusOr<Message>& answer) {
          const absl::Status status = PlainStatus(answer);
          Judge(status);
          done(status);
        },
        options_.worker_deadline_ns * kFirstAnswerFactor);
  }

  void GiveUp(const absl::Status& why) override { channel_->Fail(why); }

  void Close() override { channel_->Close(); }

 private:
  absl::Status OnOpened(const absl::StatusOr<Message>& answer) {
    if (!answer.ok()) return absl::FailedPreconditionError(answer.status().message());
    if (answer->type != MessageType::kReady) {
      const absl::Status status = PlainStatus(answer);
      return status.ok() ? absl::FailedPreconditionError("the worker has no engine") : status;
    }
    const auto ready = answer->As<ReadyMessage>();
    if (!ready.has_value())
      return absl::FailedPreconditionError("the worker's answer is too short");
    info_.kind = ready->kind;
    info_.device = std::string(ready->device, strnlen(ready->device, sizeof(ready->device)));
    if (info_.kind == EngineKind::kCpu) info_.device += ", in a process of its own";
    return absl::OkStatus();
  }

  // After an answer with a DataLoss, the engine is lost.
  void Judge(const absl::Status& answered) {
    if (absl::IsDataLoss(answered)) channel_->Fail(answered);
  }

  // Shows the worker the segments of these blocks, before the next message is sent.
  absl::Status Show(std::span<const BulkBlock> blocks) {
    sync::MutexLock lock(mutex_);
    for (const BulkBlock& block : blocks) {
      const std::shared_ptr<BulkSegment>& segment = block.segment();
      if (shown_.contains(segment->id())) continue;
      if (segment->memory()->fd() < 0) {
        return absl::InvalidArgumentError(
            "the delta refers to bulk memory of this process alone; an engine in another one takes "
            "blocks of a pool that is shared");
      }
      absl::erase_if(shown_, [](const auto& entry) { return entry.second.expired(); });
      shown_[segment->id()] = segment;
      const BulkSegmentMessage named{segment->id(), segment->memory()->bytes().size()};
      Message message = MakeMessage(MessageType::kBulkSegment, 0, named);
      message.fd = segment->memory()->fd();
      channel_->Tell(std::move(message), segment->memory());
      segment->WhenGone(channel_, [channel = channel_.get(), named] {
        channel->Tell(MakeMessage(MessageType::kDropBulkSegment, 0, named), nullptr);
      });
    }
    return absl::OkStatus();
  }

  // Passes the answer of `ask` to `done`: on the engine's thread, or inside this call if calls are
  // inline.
  template <typename Result, typename DoneFunction, typename AskFor>
  void Ask(DoneFunction done, AskFor&& ask) {
    if (!options_.inline_execution) {
      return ask(std::function<void(Result)>(
          [done = std::move(done)](Result result) { done(std::move(result)); }));
    }
    done(Await<Result>([&](std::function<void(Result)> answer) { ask(std::move(answer)); }));
  }

  // Answers in the call's turn, without asking the worker.
  template <typename DoneFunction>
  void Refuse(DoneFunction done, absl::Status status) {
    if (options_.inline_execution) return done(std::move(status));
    channel_->Later([done = std::move(done), status = std::move(status)]() mutable {
      done(std::move(status));
    });
  }

  // A segment for a frame, and the number of the target that it is for.
  struct Slot {
    SegmentPool::Lease lease;
    uint64_t target = 0;
  };

  absl::StatusOr<Slot> TakeSlot(const FrameBuffer& buffer) {
    const size_t size = buffer.changed_in.size_bytes() + buffer.bytes.size();
    Slot slot;
    {
      sync::MutexLock lock(mutex_);
      slot.target = target_;
      if (!slots_.empty()) {
        slot.lease = std::move(slots_.back());
        slots_.pop_back();
      }
    }
    if (slot.lease != nullptr && slot.lease->segment->bytes().size() >= size) return slot;
    absl::StatusOr<SegmentPool::Lease> fresh = results_.Acquire(std::max<size_t>(1, size));
    if (!fresh.ok()) return fresh.status();
    slot.lease = *std::move(fresh);
    slot.lease->holds = 0;
    std::fill_n(slot.lease->segment->bytes().begin(), buffer.changed_in.size_bytes(), std::byte{0});
    return slot;
  }

  absl::StatusOr<FrameResult> TakeFrame(const absl::StatusOr<Message>& message,
                                        const FrameRequest& request, const FrameBuffer& buffer,
                                        const FrameMessage& sent, const Slot& slot) {
    if (!message.ok()) return message.status();
    if (message->type == MessageType::kDone) {
      const absl::Status status = StatusOf(*message);
      return status.ok() ? absl::DataLossError("a frame without a result") : status;
    }
    const auto done = message->As<FrameDoneMessage>();
    std::optional<display::FrameLayout> layout;
    {
      sync::MutexLock lock(mutex_);
      layout = layout_;
    }
    if (!done.has_value() || message->type != MessageType::kFrameDone || !layout.has_value()) {
      return absl::DataLossError("the worker's answer to a frame is none");
    }
    const FrameSlot in{layout->pictures(), layout->bytes()};
    if (buffer.bytes.size() != in.bytes || buffer.changed_in.size() != in.pictures) {
      return absl::DataLossError("the worker took a buffer of the wrong size");
    }
    const FrameBuffer from = in.In(slot.lease->segment->bytes());
    if (done->result.frame != request.frame) {
      return absl::DataLossError("the worker answered with another frame");
    }
    const PictureRange mine = PictureRange::Of(*layout, options_.part.Within(layout->slices));
    if (CopyFrame(*layout, from, sent.holds, mine, buffer, request.buffer_holds, *executor_) !=
        done->crc) {
      return absl::DataLossError("a frame was damaged on its way from the worker");
    }
    sync::MutexLock lock(mutex_);
    if (slot.target == target_) {
      slot.lease->holds = request.frame;
      slots_.push_back(slot.lease);
    }
    return done->result;
  }

  const EngineOptions options_;
  EngineInfo info_;
  std::shared_ptr<CallChannel> channel_;
  const std::shared_ptr<WorkerStaging> staging_;
  const std::shared_ptr<SegmentNews> news_ = std::make_shared<SegmentNews>();  // for results_
  SegmentPool results_;
  sync::Mutex mutex_;
  std::optional<display::FrameLayout> layout_ VOXELD_GUARDED_BY(mutex_);  // the worker has it
  uint64_t target_ VOXELD_GUARDED_BY(mutex_) = 0;                         // number of those sent
  std::vector<SegmentPool::Lease> slots_ VOXELD_GUARDED_BY(mutex_);       // for frames, newest last
  // The segments of bulk memory that the worker knows, by number.
  absl::flat_hash_map<uint64_t, std::weak_ptr<BulkSegment>> shown_ VOXELD_GUARDED_BY(mutex_);
  // On the channel's thread.
  BulkLedger ledger_;
  std::unique_ptr<Executor> executor_;  // checks frames
};

absl::StatusOr<std::shared_ptr<CallChannel>> Connect(const EngineOptions& options) {
  const std::string program =
      options.worker.empty() ? DefaultWorkerProgram(RunningProgram()) : options.worker;
  absl::StatusOr<std::shared_ptr<WorkerProcess>> process =
      options.workers == nullptr ? WorkerProcess::Start(program)
                                 : options.workers->Acquire(program, options.kind, options.device);
  if (!process.ok()) return process.status();
  const absl::StatusOr<int> socket = (*process)->Connect();
  if (!socket.ok()) return absl::FailedPreconditionError(socket.status().message());
  const int wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (wake < 0) {
    close(*socket);
    return absl::FailedPreconditionError(
        absl::StrCat("no event for a worker: ", std::generic_category().message(errno)));
  }
  try {
    return std::make_shared<CallChannel>(
        *std::move(process), *socket, wake, options.worker_deadline_ns,
        options.worker_deadline_ns * kFirstAnswerFactor, options.lost);
  } catch (const std::exception& e) {
    close(*socket);
    close(wake);
    return absl::FailedPreconditionError(absl::StrCat("no thread for a worker: ", e.what()));
  }
}

absl::StatusOr<std::unique_ptr<WorkerEngine>> Create(
    const EngineOptions& options, std::string reason, std::shared_ptr<WorkerStaging> staging,
    std::function<void(const absl::Status&)> opened) {
  absl::StatusOr<std::shared_ptr<CallChannel>> channel = Connect(options);
  if (!channel.ok()) return channel.status();
  auto engine = std::make_unique<WorkerEngine>(options, std::move(reason), std::move(staging),
                                               *std::move(channel));
  if (absl::Status status = engine->Open(std::move(opened)); !status.ok()) return status;
  return engine;
}

}  // namespace

bool IsLate(const absl::Status& status) { return status.GetPayload(kLatePayload).has_value(); }

absl::StatusOr<std::unique_ptr<Engine>> CreateWorkerEngine(const EngineOptions& options,
                                                           std::string reason) {
  return Create(options, std::move(reason),
                std::make_shared<WorkerStaging>(options.staging_limit_bytes), nullptr);
}

absl::StatusOr<std::unique_ptr<RankWorker>> CreateRankWorker(
    const EngineOptions& options, std::shared_ptr<WorkerStaging> staging,
    std::function<void(const absl::Status&)> opened) {
  EngineOptions own = options;
  own.workers = nullptr;
  own.inline_execution = false;
  own.wait_until_ready = false;
  return Create(own, "", std::move(staging), std::move(opened));
}

}  // namespace voxeld::gpu
