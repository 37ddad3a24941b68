// Monitors the process: its memory, pauses in its execution, and steps of the wall clock.
#pragma once

#include <atomic>
#include <cstdint>

#include "daemon/core/stats.h"
#include "daemon/log/logger.h"
#include "daemon/process/process.h"
#include "daemon/process/segment_watch.h"
#include "daemon/process/time_watch.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// Thread-safe except for Look. Create one per process; all constructor arguments must outlive it.
class ProcessWatch {
 public:
  // How often free memory is returned to the system, and how often allocated memory is counted.
  // Both walk through all free blocks while other threads that allocate wait, so they may take at
  // most a thousandth of the time.
  static constexpr sync::TimeNs kGiveBack = 60 * sync::kSecond, kCount = sync::kSecond;
  static constexpr int64_t kRest = 1000;
  // If this much was freed since memory was last returned, for example because a large scene was
  // removed, it is returned at once, and again after kGiveBackAgain, when the rest of the scene may
  // have been freed. This may take a twentieth of the time.
  static constexpr uint64_t kMuch = uint64_t{8} << 20;
  static constexpr sync::TimeNs kGiveBackAgain = 3 * sync::kSecond;
  static constexpr int64_t kRestOfMuch = 20;

  struct Allocator {
    void (*give_back)() = &GiveBackFreeMemory;
    uint64_t (*count)() = &HeapBytes;
  };

  ProcessWatch(sync::Clock& clock, Logger& log) : ProcessWatch(clock, log, Allocator{}) {}
  ProcessWatch(sync::Clock& clock, Logger& log, Allocator allocator)
      : clock_(clock),
        allocator_(allocator),
        segments_(clock, log),
        time_(log),
        heap_bytes_(allocator.count()),
        give_back_at_(clock.Now() + kGiveBack),
        count_at_(clock.Now() + kCount) {}

  // Call about once a second, from one thread. `held_bytes` is the memory of clients' scenes
  // according to the budget, `peak_bytes` its peak since the last call. Returns: true if free
  // memory was returned to the system; the caller should then return the unused memory of its own
  // pools.
  bool Look(uint64_t held_bytes = 0, uint64_t peak_bytes = 0);
  void LookAtTime() { time_.Look(); }  // see TimeWatch::Look
  ProcessFigures figures() const;

 private:
  // Returns: when to repeat work that began at `begun`: after `period` if it was quick, else later.
  sync::TimeNs Next(sync::TimeNs begun, sync::TimeNs period, int64_t rest = kRest) const;

  sync::Clock& clock_;
  const Allocator allocator_;
  SegmentWatch segments_;
  TimeWatch time_;
  std::atomic<uint64_t> heap_bytes_;
  // Only the thread that calls Look uses these.
  sync::TimeNs give_back_at_, count_at_, much_at_ = 0;
  // Peaks since memory was last returned.
  uint64_t most_bytes_ = 0, most_held_ = 0;
};

}  // namespace voxeld::daemon
