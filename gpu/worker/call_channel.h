// An owner's conversation with its worker: calls out, answers in, on a thread of its own; and the
// verdict when none come.
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
  // What a call came to: its answer, DataLoss (the worker is gone, or did not answer in time), or
  // Cancelled (the channel is being closed).
  using Answered = std::function<void(absl::StatusOr<Message>)>;

  // `deadline_ns`: the longest time between answers while any is owed; for the first answer of all
  // `first_deadline_ns`. When it has passed, or the process has ended, that is killed.
  // `socket`: a connection to `process`; `wake`: an eventfd that does not block; both are closed at
  // the end. `lost` (may be empty) is called once,
  // on the channel's thread, with the DataLoss that ends it, after all that was owed is answered.
  CallChannel(std::shared_ptr<WorkerProcess> process, int socket, int wake, int64_t deadline_ns,
              int64_t first_deadline_ns, std::function<void(const absl::Status&)> lost);
  ~CallChannel();
  CallChannel(const CallChannel&) = delete;
  CallChannel& operator=(const CallChannel&) = delete;

  // Ends the connection and answers all that is owed, Cancelled, before it returns.
  void Close();
  // The same with `status`, soon: what the worker says is not to be believed.
  void Fail(const absl::Status& status);

  // Sends a message, in the order of the calls of this function. `message.call` is filled in.
  // `ready` (may be empty) completes the message just before it goes, on the channel's thread.
  // `more_ns`: what this call may take beyond the deadline.
  void Call(Message message, std::function<void(Message&)> ready, Answered answered,
            int64_t more_ns = 0);
  // Runs `work` on the channel's thread, after all that was sent before; at once when the worker is
  // gone.
  void Later(std::function<void()> work);
  // A message without an answer; `segment` lives until it is sent.
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
  // Sends what can be sent; not OK if the worker is gone.
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
  absl::Status ended_ VOXELD_GUARDED_BY(mutex_);  // not OK: nothing goes or comes any more
  uint64_t next_call_ VOXELD_GUARDED_BY(mutex_) = 1;
  std::deque<Outgoing> outgoing_ VOXELD_GUARDED_BY(mutex_);
  std::map<uint64_t, Owed> owed_ VOXELD_GUARDED_BY(mutex_);
  sync::TimeNs give_up_at_ VOXELD_GUARDED_BY(mutex_) = sync::kNever;
  int64_t allowed_ns_ VOXELD_GUARDED_BY(mutex_);
  std::thread thread_;
};

}  // namespace voxeld::gpu
