#include "display/usb/slab_memory.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace voxeld::display {
namespace {

std::vector<void*> Ascending(std::vector<void*> slabs) {
  std::sort(slabs.begin(), slabs.end(), std::less<>());
  return slabs;
}

}  // namespace

SlabMemory::SlabMemory(std::vector<void*> slabs, size_t slab_bytes)
    : slabs_(Ascending(std::move(slabs))), slab_bytes_(slab_bytes), free_(slabs_) {
  free_.reserve(slabs_.size());
}

void* SlabMemory::Allocate(size_t bytes) {
  // A small buffer would waste a slab.
  if (bytes <= slab_bytes_ && bytes > slab_bytes_ / 2) {
    sync::MutexLock lock(mutex_);
    if (!free_.empty()) {
      void* const slab = free_.back();
      free_.pop_back();
      return slab;
    }
  }
  return ::operator new(bytes);
}

void SlabMemory::Free(void* memory, size_t /*bytes*/) noexcept {
  if (!std::binary_search(slabs_.begin(), slabs_.end(), memory, std::less<>())) {
    return ::operator delete(memory);
  }
  sync::MutexLock lock(mutex_);
  free_.push_back(memory);
}

bool SlabMemory::Owns(const void* memory) const {
  const auto after = std::upper_bound(slabs_.begin(), slabs_.end(), memory, std::less<>());
  return after != slabs_.begin() && static_cast<const std::byte*>(memory) <
                                        static_cast<const std::byte*>(*(after - 1)) + slab_bytes_;
}

}  // namespace voxeld::display
