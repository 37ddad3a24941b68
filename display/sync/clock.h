// Time as a dependency. All times in voxeld are monotonic nanoseconds from an injected Clock: the
// system's in the daemon, a FakeClock (fake_clock.h) in tests and simulations.
//
// Thread-safe.
#pragma once

#include <cstdint>

#include "display/sync/mutex.h"

namespace voxeld::sync {

// Nanoseconds on a clock's own monotonic scale; only differences mean anything.
using TimeNs = int64_t;

inline constexpr TimeNs kNever = INT64_MAX;
inline constexpr TimeNs kMillisecond = 1'000'000;
inline constexpr TimeNs kSecond = 1'000'000'000;

class Clock {
 public:
  virtual ~Clock() = default;

  virtual TimeNs Now() const = 0;

  // Waits until `cv` is notified or Now() >= deadline, whichever is first; may wake spuriously.
  // `mutex` must be held and guard the condition. deadline == kNever waits for a notification only.
  virtual void WaitUntil(Mutex& mutex, CondVar& cv, TimeNs deadline) VOXELD_REQUIRES(mutex) = 0;
};

// Uses std::chrono::steady_clock.
class SystemClock final : public Clock {
 public:
  TimeNs Now() const override;
  void WaitUntil(Mutex& mutex, CondVar& cv, TimeNs deadline) override VOXELD_REQUIRES(mutex);
};

}  // namespace voxeld::sync
