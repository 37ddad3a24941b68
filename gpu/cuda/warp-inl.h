// Sums over a warp.
#pragma once

#include <cstdint>

namespace voxeld::gpu::cuda {

inline constexpr uint32_t kAllLanes = 0xFFFFFFFFu;

// Returns the sum of the warp's values up to and including this lane's.
__device__ inline uint32_t SumUntil(uint32_t value) {
  for (uint32_t lanes = 1; lanes < 32; lanes <<= 1) {
    const uint32_t other = __shfl_up_sync(kAllLanes, value, lanes);
    if (threadIdx.x % 32 >= lanes) value += other;
  }
  return value;
}

// Returns the sum of the values of the lanes before this one; and, in `total`, of all lanes.
__device__ inline uint32_t SumBefore(uint32_t value) { return SumUntil(value) - value; }
__device__ inline uint32_t SumBefore(uint32_t value, uint32_t& total) {
  const uint32_t sum = SumUntil(value);
  total = __shfl_sync(kAllLanes, sum, 31);
  return sum - value;
}

}  // namespace voxeld::gpu::cuda
