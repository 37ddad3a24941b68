// Memory for transfers: slabs of one size, made once and used again; what is larger than a slab, or
// comes when all are taken, is ordinary memory.
#pragma once

#include <cstddef>
#include <vector>

#include "display/sync/mutex.h"
#include "display/usb/transfer_bytes.h"

namespace voxeld::display {

// Who made the slabs frees them; an implementation's destructor is called when the last bytes are
// gone.
class SlabMemory : public TransferMemory {
 public:
  // `slabs` of `slab_bytes` each, which outlive this object.
  SlabMemory(std::vector<void*> slabs, size_t slab_bytes);

  void* Allocate(size_t bytes) override;
  void Free(void* memory, size_t bytes) noexcept override;
  // Does `memory` lie in a slab? Any thread.
  bool Owns(const void* memory) const;

 private:
  const std::vector<void*> slabs_;  // ascending
  const size_t slab_bytes_;
  sync::Mutex mutex_;
  std::vector<void*> free_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::display
