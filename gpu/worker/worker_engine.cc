#include "gpu/worker/worker_engine.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <cstring>
#include <exception>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"
#include "display/crc/crc32c.h"
#include "display/sync/mutex.h"
#include "gpu/checks.h"
#include "gpu/worker/bulk_ledger.h"
#include "gpu/worker/call_channel.h"
#include "gpu/worker/process.h"
#include "gpu/worker/segment_pool.h"
#include "gpu/worker/target_codec.h"
#include "gpu/worker/worker_pool.h"

namespace voxeld::gpu {
namespace {

// The first answer comes once there is a CUDA context, which can take seconds.
constexpr int64_t kFirstAnswerFactor = 10;
// What a byte that goes with a call may take: checked and copied twice, on a slow host.
constexpr int64_t kNsPerByte = 4;

class LeasedMemory final : public StagingBlock::Memory {
 public:
  LeasedMemory(SegmentPool::Lease lease, size_t size) : lease_(std::move(lease)), size_(size) {}
  std::span<std::byte> bytes() override { return lease_->segment->bytes().first(size_); }
  const SegmentPool::Lease& lease() const { return lease_; }

 private:
  const SegmentPool::Lease lease_;
  const size_t size_;
};

// An answer that is a status only.
absl::Status PlainStatus(const absl::StatusOr<Message>& answer) {
  if (!answer.ok()) return answer.status();
  if (answer->type != MessageType::kDone) return absl::DataLossError("an answer of another type");
  return StatusOf(*answer);
}

// Names the first `size` bytes of a segment, their CRC worked out when they go.
std::function<void(Message&)> NameBulk(SegmentPool::Lease lease, size_t size) {
  return [lease = std::move(lease), size](Message& message) {
    const uint32_t crc = display::Crc32c(lease->segment->bytes().first(size));
    message.body = MakeMessage(message.type, 0, BulkMessage{lease->id, crc, size}).body;
  };
}

class WorkerEngine final : public Engine {
 public:
  WorkerEngine(const EngineOptions& options, std::string reason,
               std::shared_ptr<WorkerProcess> process, int socket, int wake)
      : options_(options),
        channel_(std::make_shared<CallChannel>(
            std::move(process), socket, wake, options.worker_deadline_ns,
            options.worker_deadline_ns * kFirstAnswerFactor, options.lost)),
        staging_(options.staging_limit_bytes, ids_, Added(), Dropped()),
        results_(UINT64_MAX, ids_, Added(), Dropped()) {
    info_.kind = options.kind;
    info_.reason = std::move(reason);
  }

  ~WorkerEngine() override { channel_->Close(); }

  // Asks for the engine; `options_.wait_until_ready` says whether the answer is waited for.
  absl::Status Open() {
    OpenMessage open;
    open.kind = options_.kind;
    open.threads = options_.threads;
    open.device = options_.device;
    open.part = options_.part;
    const auto ask = [&](std::function<void(absl::Status)> opened) {
      channel_->Call(MakeMessage(MessageType::kOpen, 0, open), nullptr,
                     [this, opened = std::move(opened)](const absl::StatusOr<Message>& answer) {
                       opened(OnOpened(answer));
                     });
    };
    if (options_.wait_until_ready) return Await<absl::Status>(ask);
    ask([this](const absl::Status& status) {
      if (!status.ok()) channel_->Fail(absl::DataLossError(status.message()));
    });
    return absl::OkStatus();
  }

  const EngineInfo& info() const override { return info_; }

  void SetTarget(Target target, Done done) override {
    const std::vector<std::byte> bytes = EncodeTarget(target);
    const absl::StatusOr<SegmentPool::Lease> lease = results_.Acquire(bytes.size());
    if (!lease.ok()) return Refuse(std::move(done), lease.status());
    std::memcpy((*lease)->segment->bytes().data(), bytes.data(), bytes.size());
    {
      sync::MutexLock lock(mutex_);
      ++target_;
      slots_.clear();  // what they hold is of another target
    }
    Ask<absl::Status>(std::move(done), [&](auto answer) {
      channel_->Call(MakeMessage(MessageType::kTarget, 0, BulkMessage{}),
                     NameBulk(*lease, bytes.size()),
                     [this, layout = target.layout, lease = *lease,
                      answer](const absl::StatusOr<Message>& message) {
                       const absl::Status status = PlainStatus(message);
                       if (status.ok()) {
                         sync::MutexLock lock(mutex_);
                         layout_ = layout;
                       }
                       answer(status);
                     });
    });
  }

  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    absl::StatusOr<SegmentPool::Lease> lease = staging_.Acquire(size);
    if (!lease.ok()) return lease.status();
    return StagingBlock(std::make_shared<LeasedMemory>(*std::move(lease), size));
  }

  void Apply(StagingBlock block, size_t size, Done done) override {
    if (const auto delta = CheckDelta(block, size); !delta.ok()) {
      return Refuse(std::move(done), delta.status());
    }
    absl::StatusOr<BulkLedger::Change> change =
        BulkLedger::ChangeOf(block.bytes().first(size), block.referred());
    if (change.ok()) {
      if (absl::Status status = Show(block.referred()); !status.ok()) change = status;
    }
    if (!change.ok()) return Refuse(std::move(done), change.status());
    const auto* memory = static_cast<const LeasedMemory*>(block.memory().get());
    SegmentPool::Lease lease = memory->lease();
    block = {};
    Ask<absl::Status>(std::move(done), [&](auto answer) {
      channel_->Call(
          MakeMessage(MessageType::kApply, 0, BulkMessage{}), NameBulk(lease, size),
          [this, lease, change = *std::move(change),
           answer](const absl::StatusOr<Message>& message) mutable {
            lease = nullptr;  // given back before the answer
            const absl::Status status = PlainStatus(message);
            if (status.ok()) ledger_.Apply(std::move(change), info_.kind == EngineKind::kCuda);
            change = {};
            answer(status);
          },
          static_cast<int64_t>(size) * kNsPerByte);
    });
  }

  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    absl::StatusOr<Slot> slot = TakeSlot(buffer);
    if (!slot.ok()) return Refuse(std::move(done), slot.status());
    Ask<absl::StatusOr<FrameResult>>(std::move(done), [&](auto answer) {
      const FrameMessage sent{slot->lease->id,          request.frame,
                              slot->lease->holds,       request.buffer_holds,
                              buffer.changed_in.size(), buffer.bytes.size()};
      channel_->Call(MakeMessage(MessageType::kFrame, 0, sent), nullptr,
                     [this, request, buffer, sent, slot = *slot,
                      answer](const absl::StatusOr<Message>& message) {
                       absl::StatusOr<FrameResult> result =
                           TakeFrame(message, request, buffer, sent, slot);
                       if (absl::IsDataLoss(result.status())) channel_->Fail(result.status());
                       answer(std::move(result));
                     });
    });
  }

  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    const absl::StatusOr<SegmentPool::Lease> lease = results_.Acquire(out.size_bytes());
    if (!lease.ok()) return Refuse(std::move(done), lease.status());
    Ask<absl::Status>(std::move(done), [&](auto answer) {
      channel_->Call(
          MakeMessage(MessageType::kVoxels, 0, VoxelsMessage{(*lease)->id, box, out.size()}),
          nullptr, [lease = *lease, out, answer](const absl::StatusOr<Message>& message) {
            const absl::Status status = PlainStatus(message);
            if (status.ok()) {
              std::memcpy(out.data(), lease->segment->bytes().data(), out.size_bytes());
            }
            answer(status);
          });
    });
  }

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

  SegmentPool::Told Added() {
    return [channel = std::weak_ptr<CallChannel>(channel_)](const SegmentPool::Item& item) {
      const std::shared_ptr<CallChannel> open = channel.lock();
      if (open == nullptr) return;
      Message message = MakeMessage(MessageType::kSegment, 0,
                                    SegmentMessage{item.id, item.segment->bytes().size()});
      message.fd = item.segment->fd();
      open->Tell(std::move(message), item.segment);
    };
  }
  SegmentPool::Told Dropped() {
    return [channel = std::weak_ptr<CallChannel>(channel_)](const SegmentPool::Item& item) {
      if (const std::shared_ptr<CallChannel> open = channel.lock()) {
        open->Tell(MakeMessage(MessageType::kDropSegment, 0, SegmentMessage{item.id, 0}), nullptr);
      }
    };
  }

  // Has the worker know the segments of these blocks, before what is sent next.
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
      segment->WhenGone(channel_, [channel = std::weak_ptr<CallChannel>(channel_), named] {
        if (const std::shared_ptr<CallChannel> open = channel.lock()) {
          open->Tell(MakeMessage(MessageType::kDropBulkSegment, 0, named), nullptr);
        }
      });
    }
    return absl::OkStatus();
  }

  // Waits for what `ask` is answered.
  template <typename Result, typename AskFor>
  static Result Await(AskFor&& ask) {
    struct Box {
      sync::Mutex mutex;
      sync::CondVar changed;
      std::optional<Result> result VOXELD_GUARDED_BY(mutex);
    };
    auto box = std::make_shared<Box>();
    ask([box](Result result) {
      sync::MutexLock lock(box->mutex);
      box->result = std::move(result);
      box->changed.NotifyAll();
    });
    sync::MutexLock lock(box->mutex);
    while (!box->result.has_value()) box->changed.Wait(box->mutex);
    return *std::move(box->result);
  }

  // Has `ask` answered to `done`: on the engine's thread, or inside this call if calls are inline.
  template <typename Result, typename DoneFunction, typename AskFor>
  void Ask(DoneFunction done, AskFor&& ask) {
    if (!options_.inline_execution) {
      return ask(std::function<void(Result)>(
          [done = std::move(done)](Result result) { done(std::move(result)); }));
    }
    done(Await<Result>([&](std::function<void(Result)> answer) { ask(std::move(answer)); }));
  }

  // An answer in its turn, without asking the worker.
  template <typename DoneFunction>
  void Refuse(DoneFunction done, const absl::Status& status) {
    if (options_.inline_execution) return done(status);
    channel_->Later([done = std::move(done), status] { done(status); });
  }

  // A segment for a frame, and the target (counted) that it is for.
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
    if (FrameCrc(*layout, from, sent.holds) != done->crc) {
      return absl::DataLossError("a frame was damaged on its way from the worker");
    }
    if (done->result.frame != request.frame) {
      return absl::DataLossError("the worker answered with another frame");
    }
    CopyFrame(*layout, from, buffer, request.buffer_holds);
    sync::MutexLock lock(mutex_);
    if (slot.target == target_) {
      slot.lease->holds = request.frame;
      slots_.push_back(slot.lease);
    }
    return done->result;
  }

  // The pictures of the engine's part that are newer than what the buffer holds.
  void CopyFrame(const display::FrameLayout& layout, const FrameBuffer& from, const FrameBuffer& to,
                 uint64_t holds) const {
    const size_t subs = static_cast<size_t>(layout.sub_frames);
    const size_t first = static_cast<size_t>(options_.part.begin) * subs;
    const size_t last =
        static_cast<size_t>(options_.part.end == -1 ? layout.slices : options_.part.end) * subs;
    const size_t size = layout.bytes_per_slice();
    for (size_t p = first; p < last; ++p) {
      to.changed_in[p] = from.changed_in[p];
      if (from.changed_in[p] <= holds) continue;
      std::memcpy(to.bytes.data() + p * size, from.bytes.data() + p * size, size);
    }
  }

  const EngineOptions options_;
  EngineInfo info_;
  std::shared_ptr<CallChannel> channel_;
  const SegmentPool::Ids ids_ = std::make_shared<std::atomic<uint32_t>>(1);
  SegmentPool staging_, results_;
  sync::Mutex mutex_;
  std::optional<display::FrameLayout> layout_ VOXELD_GUARDED_BY(mutex_);  // that the worker has
  uint64_t target_ VOXELD_GUARDED_BY(mutex_) = 0;                         // sent, counted
  std::vector<SegmentPool::Lease> slots_ VOXELD_GUARDED_BY(mutex_);       // for frames, newest last
  // The segments of bulk memory that the worker knows, by number.
  absl::flat_hash_map<uint64_t, std::weak_ptr<BulkSegment>> shown_ VOXELD_GUARDED_BY(mutex_);
  BulkLedger ledger_;  // on the channel's thread
};

std::filesystem::path RunningProgram() {
  char path[PATH_MAX];
  const ssize_t size = readlink("/proc/self/exe", path, sizeof(path));
  return std::string(path, static_cast<size_t>(std::max<ssize_t>(0, size)));
}

}  // namespace

bool IsLate(const absl::Status& status) { return status.GetPayload(kLatePayload).has_value(); }

std::string DefaultWorkerProgram(const std::filesystem::path& running) {
  const std::filesystem::path folder = running.parent_path();
  const std::filesystem::path above = folder.parent_path();
  for (const std::filesystem::path& place : {folder, above}) {
    std::error_code error;
    if (std::filesystem::exists(place / "voxeld-engine", error)) return place / "voxeld-engine";
  }
  return above / "libexec/voxeld/voxeld-engine";
}

absl::StatusOr<std::unique_ptr<Engine>> CreateWorkerEngine(const EngineOptions& options,
                                                           std::string reason) {
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
  std::unique_ptr<WorkerEngine> engine;
  try {
    engine = std::make_unique<WorkerEngine>(options, std::move(reason), *std::move(process),
                                            *socket, wake);
  } catch (const std::exception& e) {
    close(*socket);
    close(wake);
    return absl::FailedPreconditionError(absl::StrCat("no thread for a worker: ", e.what()));
  }
  if (absl::Status status = engine->Open(); !status.ok()) return status;
  return engine;
}

}  // namespace voxeld::gpu
