// Work for one thread: a queue of closures that any thread may fill,
// and a wait that ends when there is more.
//
// Post, Wake and Close are thread-safe; RunPosted and Wait belong to the loop's one thread.
#pragma once

#include <functional>
#include <vector>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

class Loop {
 public:
  explicit Loop(sync::Clock& clock) : clock_(clock) {}
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  // False, and `work` is dropped, once the loop is closed.
  bool Post(std::function<void()> work);
  // Ends a Wait, this one or the next.
  void Wake();
  // What is queued still runs.
  void Close();
  bool closed() const;

  // Runs what had been posted by now, in order. False if there was nothing.
  bool RunPosted();
  // Returns when something is posted, on Wake, or at `deadline`; at once if that was so already.
  void Wait(sync::TimeNs deadline);
  // Whether a Wait would return at once, whatever its deadline.
  bool Ready() const;

 private:
  bool ready() const VOXELD_REQUIRES(mutex_) { return !posted_.empty() || woken_ || closed_; }

  sync::Clock& clock_;
  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  std::vector<std::function<void()>> posted_ VOXELD_GUARDED_BY(mutex_);
  bool woken_ VOXELD_GUARDED_BY(mutex_) = false;
  bool closed_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::daemon
