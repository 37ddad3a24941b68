// Implements SceneService.WatchScene. The next message is created when gRPC has taken the last one.
// A client that does not read therefore holds one message and two snapshots, and delays nobody;
// after watch_write_limit_ns it holds only the message.
#include <grpcpp/alarm.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/scene_watch.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "daemon/wire/watch_messages.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::daemon::services {
namespace {

// Owns itself until gRPC has finished with it. Its turns (a start, a written message, an alarm) run
// one at a time on gRPC's threads; End and Wake may be called at any time.
class SceneWatchCall final : public grpc::ServerWriteReactor<grpc::ByteBuffer>,
                             public ActiveCall,
                             public std::enable_shared_from_this<SceneWatchCall> {
 public:
  SceneWatchCall(ServiceContext& context, const v1::WatchSceneRequest& request)
      : context_(context), scene_(context.core.scene_watch()), messages_(request) {}

  void Start() {
    self_ = shared_from_this();
    context_.calls.Add(self_);
    absl::StatusOr<WatchSlots::Slot> slot = context_.scene_watches.Take(caller().who);
    if (!slot.ok()) return End(slot.status());
    {
      sync::MutexLock lock(mutex_);
      slot_ = *std::move(slot);
    }
    TakeTurn();
  }

  void End(const absl::Status& status) override {
    sync::MutexLock lock(mutex_);
    if (end_.has_value()) return;
    end_ = status;
    if (!writing_) Finish(ToGrpc(*end_));
  }

  void OnWriteDone(bool ok) override {
    {
      sync::MutexLock lock(mutex_);
      writing_ = false;
      outgoing_.Clear();
      Release();
      if (end_.has_value()) return Finish(ToGrpc(*end_));
    }
    if (!ok) return End(absl::CancelledError("the client is gone"));
    TakeTurn();
  }

  void OnCancel() override { End(absl::CancelledError("the client is gone")); }

  void OnDone() override {
    SnapshotWaitId waiting = 0;
    std::unique_ptr<grpc::Alarm> alarm, stall_alarm;
    {
      sync::MutexLock lock(mutex_);
      waiting = waiting_;
      alarm = std::move(alarm_);
      stall_alarm = std::move(stall_alarm_);
      Release();
      slot_.Release();
    }
    scene_.Cancel(waiting);
    context_.calls.Remove(this);
    alarm.reset();
    stall_alarm.reset();
    const std::shared_ptr<SceneWatchCall> last = std::move(self_);
  }

 private:
  void Release() VOXELD_REQUIRES(mutex_) {
    context_.core.budget()->Release(Budget::Use::kAnswers, std::exchange(charged_, 0));
  }

  void TakeTurn() {
    if (messages_.in_sync()) {
      SnapshotPtr newest = scene_.newest();
      if (newest->number == messages_.told()) return AwaitNewer();
      messages_.Begin(std::move(newest));
    }
    v1::WatchSceneResponse message;
    if (absl::Status made = messages_.Next(&message); !made.ok()) return End(made);
    grpc::ByteBuffer bytes;
    bool owned = false;
    const grpc::Status packed =
        grpc::SerializationTraits<v1::WatchSceneResponse>::Serialize(message, &bytes, &owned);
    if (!packed.ok()) return End(absl::InternalError("a message could not be put into bytes"));
    Budget& budget = *context_.core.budget();
    const uint64_t size = bytes.Length();
    if (!budget.Charge(Budget::Use::kAnswers, size)) {
      return End(absl::ResourceExhaustedError(absl::StrCat(
          "a message of ", size, " bytes would be held beside ", budget.used_bytes(),
          " of all clients; max_memory_bytes allows ", budget.limit_bytes(),
          ": watch a layer or an owner alone, or without contents, or try again later")));
    }
    sync::MutexLock lock(mutex_);
    charged_ += size;
    if (end_.has_value()) return;
    outgoing_.Swap(&bytes);
    writing_ = true;
    stall_at_ = context_.clock.Now() + context_.limits.watch_write_limit_ns;
    StartWrite(&outgoing_);
    if (stall_alarm_ == nullptr) LookForStallAt(stall_at_);
  }

  // One alarm serves many messages: it fires when the first message would be late, and is then set
  // for the current one.
  void LookForStallAt(sync::TimeNs at) VOXELD_REQUIRES(mutex_) {
    const sync::TimeNs wait = std::max<sync::TimeNs>(0, at - context_.clock.Now());
    stall_alarm_ = std::make_unique<grpc::Alarm>();
    stall_alarm_->Set(
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(wait, GPR_TIMESPAN)),
        [self = shared_from_this()](bool due) {
          if (due) self->LookForStall();
        });
  }

  // Ends the watch if the current message is late. The message stays with gRPC, so that the client
  // learns the reason when it resumes reading.
  void LookForStall() {
    SnapshotPtr told, target;  // destroyed without the lock
    sync::MutexLock lock(mutex_);
    if (end_.has_value()) return;
    if (!writing_) return stall_alarm_.reset();
    if (context_.clock.Now() < stall_at_) return LookForStallAt(stall_at_);
    end_ = absl::ResourceExhaustedError(absl::StrCat(
        "the client took no message for ", context_.limits.watch_write_limit_ns / 1'000'000,
        " ms, which is watch_write_limit_ns: the scene is no longer held for it; read on while "
        "watching, or watch anew"));
    // Frees the slot for other watches until the client resumes reading. The second set of slots
    // limits clients that never do.
    absl::StatusOr<WatchSlots::Slot> stalled = context_.stalled_watches.Take(caller().who);
    if (stalled.ok()) slot_ = *std::move(stalled);
    // No turn runs while a message is being written, nor afterwards.
    messages_.LetGo(&told, &target);
  }

  void AwaitNewer() {
    const SnapshotWaitId id = scene_.Await(messages_.told(), [weak = weak_from_this()] {
      if (const std::shared_ptr<SceneWatchCall> self = weak.lock()) self->Wake();
    });
    {
      sync::MutexLock lock(mutex_);
      waiting_ = std::max(waiting_, id);  // the next turn may already be waiting
      if (!end_.has_value()) return;
    }
    scene_.Cancel(id);
  }

  // Runs the next turn on a gRPC thread.
  void Wake() {
    sync::MutexLock lock(mutex_);
    if (end_.has_value()) return;
    alarm_ = std::make_unique<grpc::Alarm>();
    alarm_->Set(gpr_now(GPR_CLOCK_MONOTONIC), [self = shared_from_this()](bool due) {
      if (due) self->TakeTurn();
    });
  }

  ServiceContext& context_;
  SceneWatch& scene_;  // owned by the core
  std::shared_ptr<SceneWatchCall> self_;
  wire::WatchMessages messages_;  // used by the running turn

  sync::Mutex mutex_;
  WatchSlots::Slot slot_ VOXELD_GUARDED_BY(mutex_);
  grpc::ByteBuffer outgoing_ VOXELD_GUARDED_BY(mutex_);
  uint64_t charged_ VOXELD_GUARDED_BY(mutex_) = 0;  // for `outgoing_`
  bool writing_ VOXELD_GUARDED_BY(mutex_) = false;
  sync::TimeNs stall_at_ VOXELD_GUARDED_BY(mutex_) = 0;  // for `outgoing_`
  std::optional<absl::Status> end_ VOXELD_GUARDED_BY(mutex_);
  SnapshotWaitId waiting_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::unique_ptr<grpc::Alarm> alarm_ VOXELD_GUARDED_BY(mutex_);
  std::unique_ptr<grpc::Alarm> stall_alarm_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* NewSceneWatch(ServiceContext& context,
                                                          access::Caller caller,
                                                          const v1::WatchSceneRequest& request) {
  const auto call = std::make_shared<SceneWatchCall>(context, request);
  call->SetCaller(std::move(caller));
  call->Start();
  return call.get();
}

}  // namespace voxeld::daemon::services
