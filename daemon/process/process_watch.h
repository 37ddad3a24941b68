// Looks after the process as a whole: its reserves of memory and threads, and whether it runs and by which time.
#pragma once

#include <cstddef>

#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "daemon/process/process.h"
#include "daemon/process/reserve_watch.h"
#include "daemon/process/time_watch.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// Thread-safe but for Look. One a process; all that it is made with outlives it.
class ProcessWatch {
 public:
  // How often the system is given what the allocator keeps.
  static constexpr sync::TimeNs kGiveBack = 60 * sync::kSecond;

  ProcessWatch(size_t reserve_bytes, sync::Clock& clock, Logger& log,
               void (*give_back)() = &GiveBackFreeMemory)
      : clock_(clock),
        log_(log),
        give_back_(give_back),
        reserve_(reserve_bytes, clock, log),
        time_(log),
        give_back_at_(clock.Now() + kGiveBack) {}

  void Look();                         // every second or so, from one thread
  void LookAtTime() { time_.Look(); }  // as TimeWatch says
  ProcessFigures figures() const;

 private:
  sync::Clock& clock_;
  Logger& log_;
  void (*const give_back_)();
  ReserveWatch reserve_;
  TimeWatch time_;
  sync::TimeNs give_back_at_;  // of the thread that looks
};

}  // namespace voxeld::daemon
