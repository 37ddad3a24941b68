// A thread for what may block, in the order in which it was asked for.
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
  // Waits for what has begun; the rest is not done, but destroyed, here. Not on the worker's own thread: what is posted
  // owns nothing that owns the worker.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  // The first one begins the thread. ResourceExhausted if there is none to be had, and `work` is not done; another may be
  // tried later.
  absl::Status Post(std::function<void()> work);
  // How much has not begun.
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
