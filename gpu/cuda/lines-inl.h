// For kernels over thin lines.
#pragma once

#include "gpu/cuda/items-inl.h"
#include "gpu/cuda/line_types.h"

namespace voxeld::gpu::cuda {

// Into the second cache.
__device__ inline void AskFor(const void* what) {
#if defined(__CUDA_ARCH__)
  asm volatile("prefetch.global.L2 [%0];" ::"l"(what));
#endif
}

__device__ inline ThinLine LoadLine(const ThinLine* line) {
  const int4* const at = reinterpret_cast<const int4*>(line);
  const int4 a = at[0], b = at[1];
  return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, static_cast<uint32_t>(b.w)};
}

// Line `i` of the rows.
__device__ inline uint64_t LineAt(const ItemList& list, uint64_t i) {
  const uint32_t d = DrawableOf(list, i);
  return list.slot(d) + (i - list.first(d));
}

}  // namespace voxeld::gpu::cuda
