#include "daemon/process/process_watch.h"

#include <algorithm>

namespace voxeld::daemon {

void ProcessWatch::Look() {
  segments_.Look();
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
  ProcessFigures figures;
  segments_.AddTo(figures);
  time_.AddTo(figures);
  figures.heap_bytes = heap_bytes_;
  return figures;
}

}  // namespace voxeld::daemon
