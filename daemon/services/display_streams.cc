// The streaming calls of DisplayService: WatchStats, WatchVolume and CaptureVolume.
#include <grpcpp/alarm.h>
#include <grpcpp/support/server_callback.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/core/volume_feed.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::daemon::services {
namespace {

// A call that sends one message at a time. Owns itself until gRPC has finished with it; the core
// may hold it longer.
template <typename Message>
class Sender : public grpc::ServerWriteReactor<Message>,
               public ActiveCall,
               public std::enable_shared_from_this<Sender<Message>> {
 public:
  explicit Sender(ServiceContext& context) : context_(context) {}

  void Begin() {
    self_ = this->shared_from_this();
    context_.calls.Add(self_);
  }

  void End(const absl::Status& status) final {
    sync::MutexLock lock(mutex_);
    if (end_.has_value()) return;
    end_ = status;
    if (!writing_) this->Finish(ToGrpc(*end_));
  }

  void OnWriteDone(bool ok) final {
    {
      sync::MutexLock lock(mutex_);
      writing_ = false;
      if (end_.has_value()) return this->Finish(ToGrpc(*end_));
    }
    if (!ok) return End(absl::CancelledError("the client is gone"));
    OnSent();
  }

  void OnCancel() final { End(absl::CancelledError("the client is gone")); }

  void OnDone() final {
    context_.calls.Remove(this);
    OnEnded();
    alarm_.reset();
    const std::shared_ptr<Sender> last = std::move(self_);
  }

 protected:
  virtual void OnSent() = 0;
  virtual void OnAlarm() {}
  virtual void OnEnded() {}  // called last, and only if Begin was called

  void Send(Message message) {
    sync::MutexLock lock(mutex_);
    if (end_.has_value()) return;
    message_ = std::move(message);
    writing_ = true;
    this->StartWrite(&message_);
  }

  void SetAlarm(sync::TimeNs delay) {
    alarm_ = std::make_unique<grpc::Alarm>();
    const gpr_timespec deadline =
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(delay, GPR_TIMESPAN));
    alarm_->Set(deadline, [self = this->shared_from_this()](bool due) {
      if (due) self->OnAlarm();
    });
  }

  ServiceContext& context_;

 private:
  std::shared_ptr<Sender> self_;
  std::unique_ptr<grpc::Alarm> alarm_;
  sync::Mutex mutex_;
  Message message_ VOXELD_GUARDED_BY(mutex_);
  bool writing_ VOXELD_GUARDED_BY(mutex_) = false;
  std::optional<absl::Status> end_ VOXELD_GUARDED_BY(mutex_);
};

class StatsWatch final : public Sender<v1::Stats> {
 public:
  static constexpr int64_t kDefaultNs = sync::kSecond;
  static constexpr int64_t kLeastNs = 10 * sync::kMillisecond;
  static constexpr int64_t kGreatestNs = 3600 * sync::kSecond;

  using Sender::Sender;

  void Start(const v1::WatchStatsRequest& request) {
    Begin();
    absl::StatusOr<WatchSlots::Slot> slot = context_.stats_watches.Take(caller().who);
    if (!slot.ok()) return End(slot.status());
    slot_ = *std::move(slot);
    interval_ns_ = request.interval_ns() == 0 ? kDefaultNs : request.interval_ns();
    once_ = request.once();
    if (interval_ns_ < kLeastNs || interval_ns_ > kGreatestNs) {
      return End(absl::InvalidArgumentError(absl::StrCat("interval_ns is ", interval_ns_, "; give ",
                                                         kLeastNs, " (10 ms) to ", kGreatestNs,
                                                         " (1 hour), or 0 for 1 s")));
    }
    Ask();
  }

 private:
  std::shared_ptr<StatsWatch> Self() {
    return std::static_pointer_cast<StatsWatch>(shared_from_this());
  }

  void Ask() {
    context_.core.GetStats([self = Self()](absl::StatusOr<Stats> stats) {
      if (!stats.ok()) return self->End(stats.status());
      v1::Stats message;
      wire::Encode(*stats, &message);
      self->Send(std::move(message));
    });
  }

  void OnSent() override {
    if (once_) return End(absl::OkStatus());
    SetAlarm(interval_ns_);
  }

  void OnAlarm() override { Ask(); }

  void OnEnded() override { slot_.Release(); }

  WatchSlots::Slot slot_;
  int64_t interval_ns_ = kDefaultNs;
  bool once_ = false;
};

// Returns: at least one.
int32_t SlicesOfAChunk(const display::FrameLayout& layout) {
  constexpr size_t kChunkBytes = 1u << 20;
  const size_t each = static_cast<size_t>(layout.width) * static_cast<size_t>(layout.height) * 3;
  return static_cast<int32_t>(std::max<size_t>(1, kChunkBytes / std::max<size_t>(1, each)));
}

v1::VolumeChunk Chunk(const display::DecodedVolume& volume, int32_t first, int32_t count) {
  v1::VolumeChunk chunk;
  chunk.mutable_slices()->set_first_slice(first);
  const std::vector<uint8_t> rgb = volume.Rgb(first, count);
  chunk.mutable_slices()->set_rgb(rgb.data(), rgb.size());
  return chunk;
}

// Watches volumes. The client's reading paces the feed: the next volume is requested when the last
// message of the previous one has been sent.
class VolumeWatch final : public Sender<v1::VolumeChunk> {
 public:
  using Sender::Sender;

  void Start(const v1::WatchVolumeRequest& request) {
    Begin();
    absl::StatusOr<WatchSlots::Slot> slot = context_.volume_watches.Take(caller().who);
    if (!slot.ok()) return End(slot.status());
    slot_ = *std::move(slot);
    context_.core.GetDisplay(
        request.name(), [self = Self()](absl::StatusOr<DisplayDescription> display) {
          if (!display.ok()) return self->End(display.status());
          self->display_ = *std::move(display);
          // Weak, because this object holds the feed.
          std::weak_ptr<VolumeWatch> weak = self;
          const auto feed = VolumeFeed::Open(self->context_.core, self->context_.clock,
                                             self->display_.info.name, [weak] {
                                               if (const auto watch = weak.lock()) watch->WakeUp();
                                             });
          bool next = false;
          {
            sync::MutexLock lock(self->feeding_);
            if (!self->over_) self->feed_ = feed;
            next = std::exchange(self->ready_, false);
          }
          if (next) self->Next();
        });
  }

 private:
  std::shared_ptr<VolumeWatch> Self() {
    return std::static_pointer_cast<VolumeWatch>(shared_from_this());
  }

  // Called on the display's thread; leaves decoding and copying to a gRPC thread.
  void WakeUp() {
    sync::MutexLock lock(feeding_);
    if (over_) return;
    ready_ = feed_ == nullptr;
    if (!ready_) SetAlarm(0);
  }

  void OnAlarm() override { Next(); }

  void Next() {
    std::shared_ptr<VolumeFeed> feed;
    {
      sync::MutexLock lock(feeding_);
      feed = feed_;
    }
    if (feed == nullptr) return;
    absl::StatusOr<std::optional<VolumeFeed::Change>> change = feed->Take();
    if (!change.ok()) return End(change.status());
    if (!change->has_value()) return;  // WakeUp will be called
    change_ = **std::move(change);
    next_ = 0;
    v1::VolumeChunk chunk;
    wire::Encode(display_, change_.volume, chunk.mutable_header());
    Send(std::move(chunk));
  }

  void OnSent() override {
    if (next_ == change_.slices.size()) return Next();
    const int32_t first = change_.slices[next_];
    const auto most = static_cast<size_t>(SlicesOfAChunk(change_.volume.layout));
    size_t count = 1;
    while (count < most && next_ + count < change_.slices.size() &&
           change_.slices[next_ + count] == first + static_cast<int32_t>(count)) {
      ++count;
    }
    next_ += count;
    Send(Chunk(change_.volume, first, static_cast<int32_t>(count)));
  }

  void OnEnded() override {
    slot_.Release();
    sync::MutexLock lock(feeding_);
    over_ = true;
    feed_ = nullptr;
  }

  // Set before the feed exists, then used by one reaction at a time.
  WatchSlots::Slot slot_;
  DisplayDescription display_;
  VolumeFeed::Change change_;
  size_t next_ = 0;  // index into change_.slices

  sync::Mutex feeding_;
  std::shared_ptr<VolumeFeed> feed_ VOXELD_GUARDED_BY(feeding_);
  bool ready_ VOXELD_GUARDED_BY(feeding_) = false;  // a change arrived before the feed existed
  bool over_ VOXELD_GUARDED_BY(feeding_) = false;
};

class Capture final : public Sender<v1::VolumeChunk> {
 public:
  static constexpr int64_t kDefaultNs = 5 * sync::kSecond;
  static constexpr int64_t kGreatestNs = 60 * sync::kSecond;

  explicit Capture(ServiceContext& context)
      : Sender(context), core_(context.core), captures_(context.captures) {}
  ~Capture() override { --*captures_; }

  void Start(const v1::CaptureVolumeRequest& request) {
    Begin();
    if (const uint32_t most = core_.limits().max_captures; ++*captures_ > most) {
      return End(absl::ResourceExhaustedError(
          absl::StrCat(most,
                       " captures are under way, which is max_captures; try again when one "
                       "has ended")));
    }
    const int64_t timeout = request.timeout_ns() == 0 ? kDefaultNs : request.timeout_ns();
    if (timeout < 0 || timeout > kGreatestNs) {
      return End(absl::InvalidArgumentError(absl::StrCat("timeout_ns is ", timeout, "; give 1 to ",
                                                         kGreatestNs, " (60 s), or 0 for 5 s")));
    }
    const uint64_t snapshot = request.at_least_snapshot();
    core_.GetDisplay(request.name(), [self = Self(), timeout,
                                      snapshot](absl::StatusOr<DisplayDescription> display) {
      if (!display.ok()) return self->End(display.status());
      self->display_ = *std::move(display);
      self->Ask(timeout, snapshot);
    });
  }

 private:
  std::shared_ptr<Capture> Self() { return std::static_pointer_cast<Capture>(shared_from_this()); }

  void Ask(sync::TimeNs timeout, uint64_t snapshot) {
    const CaptureId id =
        core_.Capture(display_.info.name, timeout, snapshot,
                      [self = Self()](absl::StatusOr<display::DecodedVolume> volume) {
                        if (!volume.ok()) return self->End(volume.status());
                        self->volume_ = *std::move(volume);
                        v1::VolumeChunk chunk;
                        wire::Encode(self->display_, self->volume_, chunk.mutable_header());
                        self->Send(std::move(chunk));
                      });
    bool over = false;
    {
      sync::MutexLock lock(asking_);
      asked_ = id;
      over = over_;
    }
    if (over) core_.CancelCapture(display_.info.name, id);
  }

  // Cancels the capture: a client that has gone must neither keep the display busy nor occupy a
  // slot.
  void OnEnded() override {
    std::optional<CaptureId> asked;
    {
      sync::MutexLock lock(asking_);
      over_ = true;
      asked = asked_;
    }
    if (asked.has_value()) core_.CancelCapture(display_.info.name, *asked);
  }

  void OnSent() override {
    const int32_t left = volume_.layout.slices - next_slice_;
    if (left == 0) return End(absl::OkStatus());
    const int32_t count = std::min(left, SlicesOfAChunk(volume_.layout));
    const int32_t first = std::exchange(next_slice_, next_slice_ + count);  // update before sending
    Send(Chunk(volume_, first, count));
  }

  Core& core_;
  const std::shared_ptr<std::atomic<uint32_t>> captures_;
  sync::Mutex asking_;
  std::optional<CaptureId> asked_ VOXELD_GUARDED_BY(asking_);
  bool over_ VOXELD_GUARDED_BY(asking_) = false;

  // Set before the first message is sent, then used by one reaction at a time.
  DisplayDescription display_;
  display::DecodedVolume volume_;
  int32_t next_slice_ = 0;
};

}  // namespace

grpc::ServerWriteReactor<v1::Stats>* NewStatsWatch(ServiceContext& context, access::Caller caller,
                                                   const v1::WatchStatsRequest& request) {
  const auto watch = std::make_shared<StatsWatch>(context);
  watch->SetCaller(std::move(caller));
  watch->Start(request);
  return watch.get();
}

grpc::ServerWriteReactor<v1::VolumeChunk>* NewVolumeWatch(ServiceContext& context,
                                                          access::Caller caller,
                                                          const v1::WatchVolumeRequest& request) {
  const auto watch = std::make_shared<VolumeWatch>(context);
  watch->SetCaller(std::move(caller));
  watch->Start(request);
  return watch.get();
}

grpc::ServerWriteReactor<v1::VolumeChunk>* NewCapture(ServiceContext& context,
                                                      access::Caller caller,
                                                      const v1::CaptureVolumeRequest& request) {
  const auto capture = std::make_shared<Capture>(context);
  capture->SetCaller(std::move(caller));
  capture->Start(request);
  return capture.get();
}

}  // namespace voxeld::daemon::services
