// Ctrl-C and SIGTERM as an event that ends waits.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <thread>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::voxelctl {

// Thread-safe. With `watch_signals`, the constructor blocks SIGINT and SIGTERM in the calling
// thread, so make it before any other thread; a thread of its own receives them. The second signal
// terminates the process immediately with 130.
class Interrupt {
 public:
  enum class Watch : uint8_t { kNothing, kSignals };
  explicit Interrupt(Watch watch);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  bool requested() const { return requested_.load(); }

  // Has the same effect as a signal.
  void Request() VOXELD_EXCLUDES(mutex_);

  // Waits until it is requested or `deadline` (of `clock`) has passed. Returns true if it was
  // requested.
  bool WaitUntil(sync::Clock& clock, sync::TimeNs deadline) VOXELD_EXCLUDES(mutex_);

  // Calls `listener` at the first request, on the thread that makes it, or immediately if that has
  // already happened. The listener must not call back into this object. RemoveListener returns when
  // no call of the listener is in progress.
  int AddListener(std::function<void()> listener) VOXELD_EXCLUDES(mutex_);
  void RemoveListener(int id) VOXELD_EXCLUDES(mutex_);

 private:
  void Run();

  std::atomic<bool> requested_ = false;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::map<int, std::function<void()>> listeners_ VOXELD_GUARDED_BY(mutex_);
  int next_id_ VOXELD_GUARDED_BY(mutex_) = 0;
  int signals_ = -1, stop_ = -1;  // descriptors that the thread waits for
  std::thread thread_;
};

}  // namespace voxeld::voxelctl
