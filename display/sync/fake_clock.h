// A clock that advances only on request: for tests and for simulations of whole systems in one
// thread.
#pragma once

#include <utility>
#include <vector>

#include "display/sync/clock.h"

namespace voxeld::sync {

class FakeClock final : public Clock {
 public:
  explicit FakeClock(TimeNs start = kSecond) : now_(start) {}

  TimeNs Now() const override;
  void WaitUntil(Mutex& mutex, CondVar& cv, TimeNs deadline) override VOXELD_REQUIRES(mutex);

  // Moves time forward and wakes every thread that waits on this clock. The caller must hold none
  // of the waiters' mutexes.
  void Advance(TimeNs delta) { AdvanceTo(Now() + delta); }
  void AdvanceTo(TimeNs time);

  // Returns the number of threads inside WaitUntil: lets a test wait for a thread to become idle.
  int waiters() const;

 private:
  mutable Mutex mutex_;
  TimeNs now_ VOXELD_GUARDED_BY(mutex_);
  std::vector<std::pair<Mutex*, CondVar*>> waiters_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::sync
