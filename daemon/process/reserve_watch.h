// Looks after the process's reserve of memory: takes back what was given up, and tells people of it.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "daemon/process/memory_reserve.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "gpu/bulk/segment.h"

namespace voxeld::daemon {

// Thread-safe.
class ReserveWatch {
 public:
  // How long figures().trouble tells of allocations that failed.
  static constexpr sync::TimeNs kTold = 60 * sync::kSecond;

  // Fills the reserve with `bytes`, if there are so many. All are to outlive it. `segments_refused`: how often the
  // system had no memory for arrays or engines so far, which the reserve is too small to help; from any thread.
  ReserveWatch(size_t bytes, sync::Clock& clock, Logger& log,
               MemoryReserve& reserve = MemoryReserve::OfProcess(),
               uint64_t (*segments_refused)() = &gpu::Segment::Refused);

  // Every second or so.
  void Look();

  ProcessFigures figures() const;

 private:
  MemoryReserve& reserve_;
  uint64_t (*const segments_refused_)();
  const size_t bytes_;
  sync::Clock& clock_;
  Logger& log_;
  mutable sync::Mutex mutex_;
  uint64_t told_ VOXELD_GUARDED_BY(mutex_) = 0;  // of the allocations that failed
  bool whole_ VOXELD_GUARDED_BY(mutex_) = true;
  sync::TimeNs failed_ns_ VOXELD_GUARDED_BY(mutex_) = 0;  // when that was seen last; 0: never
  uint64_t segments_told_ VOXELD_GUARDED_BY(mutex_) = 0;
  sync::TimeNs segments_ns_ VOXELD_GUARDED_BY(mutex_) = 0;  // the same of segments
};

}  // namespace voxeld::daemon
