#include "gpu/assemble/block_pool.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <iterator>
#include <utility>

namespace voxeld::gpu {
namespace {

constexpr size_t kSlabBytes = size_t{2} << 20;  // a large page

}  // namespace

void BlockPool::Reset(size_t block_bytes, size_t most) {
  free_.clear();
  left_ = 0;
  slabs_.clear();
  block_bytes_ = block_bytes;
  slab_blocks_ = std::max<size_t>(1, std::min(most, kSlabBytes / block_bytes));
}

void BlockPool::Provide(size_t count) {
  while (free_.size() < count) {
    Slab slab{AllocatePages(slab_blocks_ * block_bytes_), 0};
    auto* const first = static_cast<std::byte*>(slab.memory.get());
    // The lowest is taken first.
    for (size_t i = slab_blocks_; i > 0; --i) free_.push_back(first + (i - 1) * block_bytes_);
    const auto at = std::lower_bound(
        slabs_.begin(), slabs_.end(), first,
        [](const Slab& a, const std::byte* b) { return std::less<>()(a.memory.get(), b); });
    slabs_.insert(at, std::move(slab));
  }
  left_ = free_.size();
}

void* BlockPool::Take() {
  const size_t before = std::atomic_ref(left_).fetch_sub(1, std::memory_order_relaxed);
  return free_[before - 1];
}

BlockPool::Slab& BlockPool::SlabOf(const std::byte* block) {
  const auto behind = std::upper_bound(
      slabs_.begin(), slabs_.end(), block,
      [](const std::byte* a, const Slab& b) { return std::less<>()(a, b.memory.get()); });
  return *std::prev(behind);
}

void BlockPool::Trim(size_t keep) {
  if (free_.size() <= keep) return;
  for (Slab& slab : slabs_) slab.free = 0;
  for (const std::byte* block : free_) ++SlabOf(block).free;
  std::erase_if(free_, [&](std::byte* block) { return SlabOf(block).free == slab_blocks_; });
  std::erase_if(slabs_, [&](const Slab& slab) { return slab.free == slab_blocks_; });
  left_ = free_.size();
}

}  // namespace voxeld::gpu
