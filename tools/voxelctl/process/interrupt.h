// Ctrl-C and SIGTERM as an event that waits can end on.
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
// thread, so make it before any other thread; a thread of its own takes them. The second one ends
// the process at once with 130.
class Interrupt {
 public:
  enum class Watch : uint8_t { kNothing, kSignals };
  explicit Interrupt(Watch watch);
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  bool requested() const { return requested_.load(); }

  // As a signal would.
  void Request() VOXELD_EXCLUDES(mutex_);

  // Until it is requested or `deadline` (of `clock`) has come. True: it was requested.
  bool WaitUntil(sync::Clock& clock, sync::TimeNs deadline) VOXELD_EXCLUDES(mutex_);

  // `listener` is called at the first request, on whatever thread makes it, or at once
  // if that has been. It must not call back into this object.
  // RemoveListener returns when no call of it is in progress.
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
