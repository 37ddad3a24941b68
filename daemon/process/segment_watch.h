// Reports that the system refused memory for clients' arrays or for engines.
#pragma once

#include <cstdint>

#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "gpu/bulk/segment.h"

namespace voxeld::daemon {

// Thread-safe.
class SegmentWatch {
 public:
  // How long health is degraded after a refusal.
  static constexpr sync::TimeNs kDegradedFor = 60 * sync::kSecond;

  // `clock` and `log` must outlive this object. `refused` returns the number of refusals since the
  // process started and must be thread-safe.
  SegmentWatch(sync::Clock& clock, Logger& log, uint64_t (*refused)() = &gpu::Segment::Refused)
      : refused_(refused), clock_(clock), log_(log), logged_(refused()) {}

  // Logs refusals since the last call. Call about once a second.
  void Look();

  // Sets segments_refused and trouble.
  void AddTo(ProcessFigures& figures) const;

 private:
  uint64_t (*const refused_)();
  sync::Clock& clock_;
  Logger& log_;
  mutable sync::Mutex mutex_;
  uint64_t logged_ VOXELD_GUARDED_BY(mutex_);
  sync::TimeNs last_ns_ VOXELD_GUARDED_BY(mutex_) = 0;  // when Look saw the last refusal; 0: never
};

}  // namespace voxeld::daemon
