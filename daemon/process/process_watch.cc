#include "daemon/process/process_watch.h"

#include <algorithm>

namespace voxeld::daemon {

bool ProcessWatch::Look(uint64_t held_bytes, uint64_t peak_bytes) {
  segments_.Look();
  if (const sync::TimeNs begun = clock_.Now(); begun >= count_at_) {
    heap_bytes_ = allocator_.count();
    count_at_ = Next(begun, kCount);
  }
  most_bytes_ = std::max<uint64_t>(most_bytes_, heap_bytes_);
  most_held_ = std::max({most_held_, held_bytes, peak_bytes});
  // The budget falls at once; the count of the heap may lag.
  const bool much = most_bytes_ - heap_bytes_ >= kMuch || most_held_ - held_bytes >= kMuch;
  const sync::TimeNs begun = clock_.Now();
  if (begun < give_back_at_ && !(much && begun >= much_at_)) return false;
  allocator_.give_back();
  much_at_ = Next(begun, 0, kRestOfMuch);
  give_back_at_ = much ? Next(begun, kGiveBackAgain, kRestOfMuch) : Next(begun, kGiveBack);
  most_bytes_ = heap_bytes_;
  most_held_ = held_bytes;
  return true;
}

sync::TimeNs ProcessWatch::Next(sync::TimeNs begun, sync::TimeNs period, int64_t rest) const {
  return begun + std::max(period, rest * (clock_.Now() - begun));
}

ProcessFigures ProcessWatch::figures() const {
  ProcessFigures figures;
  segments_.AddTo(figures);
  time_.AddTo(figures);
  figures.heap_bytes = heap_bytes_;
  return figures;
}

}  // namespace voxeld::daemon
