// Buffers for volumes, used again when nobody holds them any more, so that an engine writes only
// what changed since a buffer's last volume.
//
// A pool belongs to one thread; the frames that it gives may be let go of anywhere,
// also after the pool is gone.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "display/api/slice_frame.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon {

class FramePool {
 public:
  explicit FramePool(const display::FrameLayout& layout);
  ~FramePool();

  struct Lease {
    std::shared_ptr<display::SliceFrame> frame;
    uint64_t holds = 0;  // the last volume that it held whole; 0: none
  };
  // The free buffer that was filled last, or a new one. Its `volume` is 0: who fills it whole
  // states the number.
  Lease Acquire();

  // Volumes up to this number count as unknown: the engine that filled them is gone.
  void Forget(uint64_t up_to_volume) { forgotten_ = up_to_volume; }

 private:
  struct Shelf {
    sync::Mutex mutex;
    std::vector<std::unique_ptr<display::SliceFrame>> free VOXELD_GUARDED_BY(mutex);
    bool open VOXELD_GUARDED_BY(mutex) = true;
  };

  const display::FrameLayout layout_;
  const std::shared_ptr<Shelf> shelf_;
  uint64_t forgotten_ = 0;
};

}  // namespace voxeld::daemon
