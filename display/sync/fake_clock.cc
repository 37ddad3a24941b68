#include "display/sync/fake_clock.h"

#include <algorithm>

namespace voxeld::sync {

TimeNs FakeClock::Now() const {
  MutexLock lock(mutex_);
  return now_;
}

void FakeClock::WaitUntil(Mutex& mutex, CondVar& cv, TimeNs deadline) {
  {
    MutexLock lock(mutex_);
    if (now_ >= deadline) return;
    waiters_.emplace_back(&mutex, &cv);
  }
  // AdvanceTo takes `mutex` before it notifies, so a wake-up between here and Wait cannot be lost.
  cv.Wait(mutex);
  MutexLock lock(mutex_);
  auto it = std::find(waiters_.begin(), waiters_.end(), std::make_pair(&mutex, &cv));
  if (it != waiters_.end()) waiters_.erase(it);
}

void FakeClock::AdvanceTo(TimeNs time) {
  std::vector<std::pair<Mutex*, CondVar*>> waiters;
  {
    MutexLock lock(mutex_);
    now_ = std::max(now_, time);
    waiters = waiters_;
  }
  for (auto& [mutex, cv] : waiters) {
    MutexLock lock(*mutex);
    cv->NotifyAll();
  }
}

int FakeClock::waiters() const {
  MutexLock lock(mutex_);
  return static_cast<int>(waiters_.size());
}

}  // namespace voxeld::sync
