// CUB's sums over an array: when called without memory, it returns how much it needs.
#pragma once

#include "tests/gpu/simt/grid.h"

namespace cub {

struct DeviceScan {
  template <typename In, typename Out, typename Operation, typename Count>
  static cudaError_t InclusiveScan(void* memory, size_t& bytes, In in, Out out,
                                   Operation&& operation, Count count, cudaStream_t) {
    if (memory == nullptr) {
      bytes = 1;
      return cudaSuccess;
    }
    for (Count i = 0; i < count; ++i) {
      out[i] = i == 0 ? in[i] : operation(out[i - 1], in[i]);
    }
    return cudaSuccess;
  }
};

}  // namespace cub
