#include "daemon/process/process_watch.h"

#include "absl/strings/str_cat.h"
#include "daemon/process/spare_threads.h"

namespace voxeld::daemon {

void ProcessWatch::Look() {
  if (const uint64_t taken = SpareThreads::Refill(); taken > 0) {
    log_.Warn("the system gave no thread: spare ones were taken",
              {{"threads", absl::StrCat(taken)}});
  }
  reserve_.Look();
  if (clock_.Now() >= give_back_at_) {
    give_back_();
    give_back_at_ = clock_.Now() + kGiveBack;
  }
}

ProcessFigures ProcessWatch::figures() const {
  ProcessFigures figures = reserve_.figures();
  time_.AddTo(figures);
  figures.heap_bytes = HeapBytes();
  return figures;
}

}  // namespace voxeld::daemon
