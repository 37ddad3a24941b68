// An owner's connection to its worker: sends calls and receives answers on a thread of its own, and
// detects when no answers come.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <thread>

#include "absl/status/statusor.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "gpu/bulk/segment.h"
#include "gpu/worker/message.h"
#include "gpu/worker/process.h"

namespace voxeld::gpu {

// Marks the DataLoss of a worker that did not answer in time.
inline constexpr char kLatePayload[] = "voxeld.dev/late";

// Thread-safe.
class CallChannel {
 public:
  // The result of a call: its answer, DataLoss (the worker is gone, or did not answer in time), or
  // Cancelled (the channel is being closed).
  using Answered = std::function<void(absl::StatusOr<Message>)>;

  // `deadline_ns`: the longest time between answers while any is pending; for the very first answer
  // it is `first_deadline_ns`. When it has passed, or the process has ended, the process is killed.
  // `socket`: a connection to `process`; `wake`: an eventfd that does not block; both are closed at
  // the end. `lost` (may be empty) is called once, on the channel's thread, with the DataLoss that
  // ends the channel, after all pending calls are answered.
  CallChannel(std::shared_ptr<WorkerProcess> process, int socket, int wake, int64_t deadline_ns,
              int64_t first_deadline_ns, std::function<void(const absl::Status&)> lost);
  ~CallChannel();
  CallChannel(const CallChannel&) = delete;
  CallChannel& operator=(const CallChannel&) = delete;

  // Ends the connection and answers all pending calls with Cancelled before it returns.
  void Close();
  // The same with `status`, soon: for a worker whose messages cannot be trusted.
  void Fail(const absl::Status& status);

  // Sends a message, in the order of the calls of this function, and fills in `message.call`.
  // `ready` (may be empty) completes the message just before it is sent, on the channel's thread.
  // `more_ns`: the time that this call may take beyond the deadline.
  void Call(Message message, std::function<void(Message&)> ready, Answered answered,
            int64_t more_ns = 0);
  // Runs `work` on the channel's thread, after everything that was sent before; at once if the
  // worker is gone.
  void Later(std::function<void()> work);
  // Sends a message that has no answer; keeps `segment` until it is sent.
  void Tell(Message message, std::shared_ptr<Segment> segment);

 private:
  struct Outgoing {
    Message message;
    std::function<void(Message&)> ready;
    std::shared_ptr<Segment> segment;
    std::function<void()> work;  // instead of a message
  };

  void Run();
  void Wake() const;
  // Sends as much as possible; not OK if the worker is gone.
  absl::Status SendSome();
  absl::Status ReceiveOne();
  void End(const absl::Status& status);
  bool HasOutgoing();

  struct Owed {
    Answered answered;
    int64_t more_ns = 0;
  };

  const int64_t deadline_ns_;
  const sync::SystemClock clock_;
  const int wake_;
  std::shared_ptr<WorkerProcess> process_;
  const int socket_;
  const std::function<void(const absl::Status&)> lost_;

  sync::Mutex mutex_;
  bool closing_ VOXELD_GUARDED_BY(mutex_) = false;
  absl::Status failed_ VOXELD_GUARDED_BY(mutex_);
  absl::Status ended_ VOXELD_GUARDED_BY(mutex_);  // not OK: nothing is sent or received
  uint64_t next_call_ VOXELD_GUARDED_BY(mutex_) = 1;
  std::deque<Outgoing> outgoing_ VOXELD_GUARDED_BY(mutex_);
  std::map<uint64_t, Owed> owed_ VOXELD_GUARDED_BY(mutex_);
  sync::TimeNs give_up_at_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  int64_t allowed_ns_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::gpu
