// Memory for transfers: slabs of one size, allocated once and reused; buffers that are larger than
// a slab, or come when all are in use, get ordinary memory.
#pragma once

#include <cstddef>
#include <vector>

#include "display/sync/mutex.h"
#include "display/usb/transfer_bytes.h"

namespace voxeld::display {

// The creator of the slabs frees them; an implementation's destructor runs when the last bytes are
// released.
class SlabMemory : public TransferMemory {
 public:
  // `slabs` of `slab_bytes` each must outlive this object.
  SlabMemory(std::vector<void*> slabs, size_t slab_bytes);

  void* Allocate(size_t bytes) override;
  void Free(void* memory, size_t bytes) noexcept override;
  // Returns whether `memory` lies in a slab. Any thread.
  bool Owns(const void* memory) const;

 private:
  const std::vector<void*> slabs_;  // ascending
  const size_t slab_bytes_;
  sync::Mutex mutex_;
  std::vector<void*> free_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::display
