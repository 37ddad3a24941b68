// Runs blocking functions on a separate thread, in the order of the calls.
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <thread>

#include "absl/status/status.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::play {

// Thread-safe.
class Worker {
 public:
  Worker() = default;
  // Waits for the function that is running; destroys the rest without running it. Must not be
  // called on the worker's own thread, so posted functions must not own an owner of the worker.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  // Queues `work`. The first call starts the thread. Errors: ResourceExhausted if no thread can be
  // started; `work` is then not run, and later calls may succeed.
  absl::Status Post(std::function<void()> work);
  // Returns: the number of functions that have not started.
  size_t waiting() const;

 private:
  void Run();

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  std::deque<std::function<void()>> waiting_ VOXELD_GUARDED_BY(mutex_);
  bool ends_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::daemon::play
