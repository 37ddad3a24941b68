#include "daemon/process/reserve_watch.h"

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {

ReserveWatch::ReserveWatch(size_t bytes, sync::Clock& clock, Logger& log, MemoryReserve& reserve,
                           uint64_t (*segments_refused)())
    : reserve_(reserve),
      segments_refused_(segments_refused),
      bytes_(bytes),
      clock_(clock),
      log_(log),
      segments_told_(segments_refused()) {
  Look();
}

void ReserveWatch::Look() {
  const sync::MutexLock lock(mutex_);
  const MemoryReserve::Figures before = reserve_.figures();
  const bool was_whole = whole_;
  whole_ = reserve_.Fill(bytes_);
  // Told once there is memory to tell it with.
  if (before.failed != told_) {
    log_.Warn("the system had no memory", {{"allocations", absl::StrCat(before.failed - told_)},
                                           {"last_bytes", absl::StrCat(before.last_bytes)},
                                           {"reserve_left", absl::StrCat(before.held_bytes)},
                                           {"refused", absl::StrCat(before.refused)}});
    told_ = before.failed;
    failed_ns_ = clock_.Now();
  }
  if (const uint64_t refused = segments_refused_(); refused != segments_told_) {
    log_.Warn("the system had no memory for arrays or engines",
              {{"times", absl::StrCat(refused - segments_told_)},
               {"hint",
                "clients were refused theirs: give the machine more, or the daemon a "
                "higher limit"}});
    segments_told_ = refused;
    segments_ns_ = clock_.Now();
  }
  if (was_whole && !whole_) {
    const MemoryReserve::Figures now = reserve_.figures();
    log_.Error("there is no memory for the reserve; it is tried again",
               {{"has", absl::StrCat(now.held_bytes)}, {"wants", absl::StrCat(now.wanted_bytes)}});
  } else if (!was_whole && whole_) {
    log_.Info("the reserve of memory is whole again");
  }
}

ProcessFigures ReserveWatch::figures() const {
  const sync::MutexLock lock(mutex_);
  const MemoryReserve::Figures now = reserve_.figures();
  ProcessFigures figures{.allocations_failed = now.failed,
                         .allocations_refused = now.refused,
                         .reserve_bytes = now.wanted_bytes,
                         .reserve_held_bytes = now.held_bytes,
                         .segments_refused = segments_refused_()};
  if (now.held_bytes < now.wanted_bytes) {
    figures.trouble = absl::StrCat("the system has no memory: of its reserve of ", now.wanted_bytes,
                                   " bytes the daemon has ", now.held_bytes,
                                   "; give the machine more, or lower max_memory_bytes");
  } else if (failed_ns_ > 0 && clock_.Now() - failed_ns_ < kTold) {
    figures.trouble =
        absl::StrCat("the system had no memory ", (clock_.Now() - failed_ns_) / sync::kSecond,
                     " s ago (", now.failed, " allocations since the start, the last of ",
                     now.last_bytes, " bytes); the reserve helped ",
                     now.refused == 0 ? "them all" : absl::StrCat("all but ", now.refused));
  }
  if (segments_ns_ > 0 && clock_.Now() - segments_ns_ < kTold) {
    absl::StrAppend(&figures.trouble, figures.trouble.empty() ? "" : "; ",
                    "the system had no memory for arrays or engines ",
                    (clock_.Now() - segments_ns_) / sync::kSecond, " s ago (",
                    figures.segments_refused, " times since the start)");
  }
  return figures;
}

}  // namespace voxeld::daemon
