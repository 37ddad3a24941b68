// CUB's sums over a block (https://nvidia.github.io/cccl/cub): the memory must not be used for
// anything else until all threads have passed a barrier.
#pragma once

#include <utility>

#include "tests/gpu/simt/kernel.h"

namespace cub {

template <typename T, int kThreads>
class BlockScan {
 public:
  struct TempStorage {
    T sums[kThreads + 1];
  };

  explicit BlockScan(TempStorage& storage) : storage_(storage) {}

  template <int kItems>
  void ExclusiveSum(const T (&in)[kItems], T (&out)[kItems], T& total) {
    T sum{};
    for (int i = 0; i < kItems; ++i) sum += in[i];
    storage_.sums[threadIdx.x] = sum;
    __syncthreads();
    if (threadIdx.x == 0) {
      T all{};
      for (T& place : storage_.sums) all += std::exchange(place, all);
    }
    __syncthreads();
    T before = storage_.sums[threadIdx.x];
    total = storage_.sums[kThreads];
    for (int i = 0; i < kItems; ++i) {
      const T value = in[i];
      out[i] = before;
      before += value;
    }
  }
  void ExclusiveSum(T in, T& out, T& total) {
    const T one[1] = {in};
    T sums[1];
    ExclusiveSum(one, sums, total);
    out = sums[0];
  }

 private:
  TempStorage& storage_;
};

}  // namespace cub
