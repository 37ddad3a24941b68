#include "daemon/wire/slice_stream.h"

#include <algorithm>
#include <limits>

namespace voxeld::daemon::wire {

bool SliceStream::Next(const void** data, int* size) {
  while (slice_ < slices_.size() && offset_ == slices_[slice_].size()) {
    ++slice_;
    offset_ = 0;
  }
  if (slice_ == slices_.size()) return false;
  const std::string_view rest = slices_[slice_].substr(offset_);
  const size_t take = std::min(rest.size(), static_cast<size_t>(std::numeric_limits<int>::max()));
  *data = rest.data();
  *size = static_cast<int>(take);
  offset_ += take;
  consumed_ += static_cast<int64_t>(take);
  return true;
}

// Requires: `count` lies within the piece that the last Next returned.
void SliceStream::BackUp(int count) {
  offset_ -= static_cast<size_t>(count);
  consumed_ -= count;
}

bool SliceStream::Skip(int count) {
  const void* data = nullptr;
  int size = 0;
  while (count > 0) {
    if (!Next(&data, &size)) return false;
    if (size > count) {
      BackUp(size - count);
      return true;
    }
    count -= size;
  }
  return true;
}

}  // namespace voxeld::daemon::wire
