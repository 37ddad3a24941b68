// When a display's coming sweeps begin, for whoever times commits. Thread-safe.
#pragma once

#include <optional>
#include <vector>

#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

class SweepOutlook {
 public:
  // The starts of the next sweep and of the one after; fewer: not known.
  void Set(const std::vector<sync::TimeNs>& coming);

  // When to apply a commit so that the first volume drawn from it is in the first sweep that starts
  // at `present_at` or later, and in none before: just after the sweep before has begun, so that
  // the volume drawn then is the next to begin. Where sweeps are not known, `present_at`.
  sync::TimeNs DueTime(sync::TimeNs present_at) const;

 private:
  struct Sweeps {
    sync::TimeNs next = 0, period = 0;
  };
  mutable sync::Mutex mutex_;
  std::optional<Sweeps> sweeps_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon
