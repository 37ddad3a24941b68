// Executes calls one after the other: in a thread of its own, or in the caller's thread.
#pragma once

#include <deque>
#include <functional>
#include <thread>

#include "display/sync/mutex.h"

namespace voxeld::gpu {

// Thread-safe.
class CallQueue {
 public:
  // If `cancelled` is true, the call must not be executed, only answered.
  using Call = std::function<void(bool cancelled)>;

  explicit CallQueue(bool run_inline);
  // Cancels calls that have not begun.
  ~CallQueue();
  CallQueue(const CallQueue&) = delete;
  CallQueue& operator=(const CallQueue&) = delete;

  void Post(Call call);

 private:
  void Run();

  const bool inline_;
  sync::Mutex inline_mutex_;  // held while a call runs in its caller's thread
  sync::Mutex mutex_;
  sync::CondVar posted_;
  std::deque<Call> calls_ VOXELD_GUARDED_BY(mutex_);
  bool stopping_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::gpu
