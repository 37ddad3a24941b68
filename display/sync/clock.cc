#include "display/sync/clock.h"

#include <chrono>

namespace voxeld::sync {

TimeNs SystemClock::Now() const {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void SystemClock::WaitUntil(Mutex& mutex, CondVar& cv, TimeNs deadline) {
  if (deadline == kNever) {
    cv.Wait(mutex);
    return;
  }
  cv.WaitUntil(mutex, std::chrono::steady_clock::time_point(std::chrono::nanoseconds(deadline)));
}

}  // namespace voxeld::sync
