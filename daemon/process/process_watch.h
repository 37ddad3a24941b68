// Looks after the process as a whole: its reserves of memory and threads, and whether it runs and by which time.
#pragma once

#include <cstddef>

#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "daemon/process/reserve_watch.h"
#include "daemon/process/time_watch.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// Thread-safe. One a process; all that it is made with outlives it.
class ProcessWatch {
 public:
  ProcessWatch(size_t reserve_bytes, sync::Clock& clock, Logger& log)
      : log_(log), reserve_(reserve_bytes, clock, log), time_(log) {}

  void Look();                         // every second or so
  void LookAtTime() { time_.Look(); }  // as TimeWatch says
  ProcessFigures figures() const;

 private:
  Logger& log_;
  ReserveWatch reserve_;
  TimeWatch time_;
};

}  // namespace voxeld::daemon
