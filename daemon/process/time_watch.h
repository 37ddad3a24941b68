// Sees what a process cannot see while it happens: that it did not run (it was stopped, or its machine was, or had no
// time for it), and that the wall clock stepped. Tells people of both.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

// Thread-safe.
class TimeWatch {
 public:
  static constexpr sync::TimeNs kTurn = sync::kSecond / 4;  // how often Look is to be called
  // What is told: of a turn that came late, and of what the wall clock did beside the other within one.
  static constexpr sync::TimeNs kPause = sync::kSecond;
  static constexpr sync::TimeNs kStep = sync::kSecond / 2;
  // How long AddTo tells of it.
  static constexpr sync::TimeNs kTold = 60 * sync::kSecond;

  // Both at one moment.
  struct Reading {
    sync::TimeNs running = 0;  // never steps, and goes on while the machine sleeps
    sync::TimeNs wall = 0;     // since 1970
  };
  // Of the system: CLOCK_BOOTTIME and CLOCK_REALTIME, with less than a millisecond between if the process can have
  // that within a few tries.
  static Reading OfSystem();

  // `log` outlives it.
  explicit TimeWatch(Logger& log, std::function<Reading()> read = OfSystem);

  // Each kTurn, from one thread that does nothing else: what is late in it is taken for the process.
  void Look();

  // pauses, clock_steps and time_trouble.
  void AddTo(ProcessFigures& figures) const;

 private:
  // The last of a kind.
  struct Seen {
    uint64_t count = 0;
    sync::TimeNs at = 0, length = 0;
  };

  Logger& log_;
  const std::function<Reading()> read_;
  mutable sync::Mutex mutex_;
  Reading last_ VOXELD_GUARDED_BY(mutex_);
  Seen pauses_ VOXELD_GUARDED_BY(mutex_), steps_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon
