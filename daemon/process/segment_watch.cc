#include "daemon/process/segment_watch.h"

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {

void SegmentWatch::Look() {
  const sync::MutexLock lock(mutex_);
  const uint64_t refused = refused_();
  if (refused == logged_) return;
  log_.Warn("the system had no memory for arrays or engines",
            {{"times", absl::StrCat(refused - logged_)},
             {"hint", "give the machine more memory, or raise the limits of this process"}});
  logged_ = refused;
  last_ns_ = clock_.Now();
}

void SegmentWatch::AddTo(ProcessFigures& figures) const {
  const sync::MutexLock lock(mutex_);
  figures.segments_refused = refused_();
  if (last_ns_ == 0 || clock_.Now() - last_ns_ >= kDegradedFor) return;
  figures.trouble = absl::StrCat("the system had no memory for arrays or engines ",
                                 (clock_.Now() - last_ns_) / sync::kSecond, " s ago (",
                                 figures.segments_refused, " times since the start)");
}

}  // namespace voxeld::daemon
