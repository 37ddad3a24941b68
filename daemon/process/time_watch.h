// Detects that the process did not run (it or its machine was stopped, or got no processor time),
// and that the wall clock stepped. Both can be noticed only afterwards. Reports both in the log and
// in the statistics.
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
  static constexpr sync::TimeNs kTurn = sync::kSecond / 4;  // interval between calls of Look
  // Thresholds for reports: for the delay of a call of Look, and for the deviation of the wall
  // clock from the running clock within one interval.
  static constexpr sync::TimeNs kPause = sync::kSecond;
  static constexpr sync::TimeNs kStep = sync::kSecond / 2;
  // How long AddTo reports an event.
  static constexpr sync::TimeNs kTold = 60 * sync::kSecond;

  // Both clocks, read at the same moment.
  struct Reading {
    sync::TimeNs running = 0;  // never steps; continues while the machine sleeps
    sync::TimeNs wall = 0;     // since 1970
  };
  // Reads CLOCK_BOOTTIME and CLOCK_REALTIME, less than a millisecond apart if a few attempts
  // suffice.
  static Reading OfSystem();

  // `log` must outlive this object.
  explicit TimeWatch(Logger& log, std::function<Reading()> read = OfSystem);

  // Call every kTurn from a thread that does nothing else: a late call is interpreted as a pause of
  // the process.
  void Look();

  // Sets pauses, clock_steps and time_trouble.
  void AddTo(ProcessFigures& figures) const;

 private:
  // The last event of one kind.
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
