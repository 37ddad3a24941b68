#include "daemon/process/process_watch.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "daemon/process/spare_threads.h"

namespace voxeld::daemon {

void ProcessWatch::Look() {
  if (const uint64_t taken = SpareThreads::Refill(); taken > 0) {
    log_.Warn("the system gave no thread: spare ones were taken",
              {{"threads", absl::StrCat(taken)}});
  }
  reserve_.Look();
  if (const sync::TimeNs begun = clock_.Now(); begun >= give_back_at_) {
    allocator_.give_back();
    give_back_at_ = Next(begun, kGiveBack);
  }
  if (const sync::TimeNs begun = clock_.Now(); begun >= count_at_) {
    heap_bytes_ = allocator_.count();
    count_at_ = Next(begun, kCount);
  }
}

sync::TimeNs ProcessWatch::Next(sync::TimeNs begun, sync::TimeNs period) const {
  return begun + std::max(period, kRest * (clock_.Now() - begun));
}

ProcessFigures ProcessWatch::figures() const {
  ProcessFigures figures = reserve_.figures();
  time_.AddTo(figures);
  figures.heap_bytes = heap_bytes_;
  return figures;
}

}  // namespace voxeld::daemon
