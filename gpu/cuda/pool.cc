#include "gpu/cuda/pool.h"

#include <algorithm>
#include <bit>

namespace voxeld::gpu::cuda {
namespace {

constexpr size_t kLeast = 4096;

// In eighths of a power of two, so that a little more or less of something fits the same block.
size_t RoundUp(size_t size) {
  size = std::max(size, kLeast);
  const size_t step = std::bit_floor(size) / 8;
  return (size + step - 1) & ~(step - 1);
}

}  // namespace

Pool::~Pool() { FreeKept(); }

void Pool::FreeKept() {
  for (const auto& [size, data] : free_) {
    cudaFree(data);
    held_ -= size;
  }
  free_.clear();
}

absl::StatusOr<Block> Pool::Acquire(size_t size) {
  size = RoundUp(size);
  const auto it = free_.lower_bound(size);
  if (it != free_.end() && it->first <= size + size / 4) {
    Block block(this, it->second, it->first);
    free_.erase(it);
    return block;
  }
  void* data = nullptr;
  const auto allocate = [&] {
    return api_.Call("cudaMalloc", [&] { return cudaMalloc(&data, size); });
  };
  absl::Status status = allocate();
  if (absl::IsResourceExhausted(status) && !free_.empty()) {
    FreeKept();
    status = allocate();
  }
  if (!status.ok()) return status;
  held_ += size;
  return Block(this, data, size);
}

}  // namespace voxeld::gpu::cuda
