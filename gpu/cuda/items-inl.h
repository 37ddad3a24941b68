// For kernels over drawables' items: a thread's number, the number of blocks, the drawable of an
// item.
#pragma once

#include <cstdint>

#include "gpu/cuda/types.h"

namespace voxeld::gpu::cuda {

inline constexpr uint32_t kItemThreads = 256;

template <typename Count>
uint32_t Blocks(Count count) {
  return static_cast<uint32_t>((count + kItemThreads - 1) / kItemThreads);
}

__device__ inline uint64_t Thread() {
  return static_cast<uint64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
}

// Sets table[few.slots[i]] = few.entries[i], by one block of threads, word by word.
__device__ inline void PutFew(TableEntry* table, const FewEntries& few, uint32_t count) {
  constexpr uint32_t kWords = sizeof(TableEntry) / sizeof(uint32_t);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t* const from = reinterpret_cast<const uint32_t*>(&few.entries[i]);
    uint32_t* const to = reinterpret_cast<uint32_t*>(&table[few.slots[i]]);
    for (uint32_t w = threadIdx.x; w < kWords; w += blockDim.x) to[w] = from[w];
  }
  __syncthreads();
  if (threadIdx.x < count) {
    TableEntry& entry = table[few.slots[threadIdx.x]];
    entry.source.record = &entry.record;
  }
}

// Returns which drawable of the list (ItemList, or a similar type) has item `i` of the row.
template <typename List>
__device__ uint32_t DrawableOf(const List& list, uint64_t i) {
  uint32_t low = 0, high = list.count;  // first(low) ≤ i < first(high)
  while (high - low > 1) {
    const uint32_t middle = low + (high - low) / 2;
    (list.first(middle) <= i ? low : high) = middle;
  }
  return low;
}

// Returns the place of item `i` of the rows, for a list in which slot(d) is the first place of the
// d-th row.
__device__ inline uint64_t PlaceOf(const ItemList& list, uint64_t i) {
  const uint32_t d = DrawableOf(list, i);
  return list.slot(d) + (i - list.first(d));
}

}  // namespace voxeld::gpu::cuda
