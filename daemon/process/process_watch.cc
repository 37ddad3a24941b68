#include "daemon/process/process_watch.h"

#include <algorithm>

namespace voxeld::daemon {

void ProcessWatch::Look() {
  segments_.Look();
  if (const sync::TimeNs begun = clock_.Now(); begun >= count_at_) {
    heap_bytes_ = allocator_.count();
    count_at_ = Next(begun, kCount);
  }
  most_bytes_ = std::max<uint64_t>(most_bytes_, heap_bytes_);
  const bool much = most_bytes_ - heap_bytes_ >= kMuch;
  const sync::TimeNs begun = clock_.Now();
  if (begun >= give_back_at_ || (much && begun >= much_at_)) {
    allocator_.give_back();
    give_back_at_ = Next(begun, kGiveBack);
    much_at_ = Next(begun, 0);
    most_bytes_ = heap_bytes_;
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
