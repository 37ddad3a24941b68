// CUB's sorting of an array: when called without memory, it returns how much it needs; afterwards,
// the sorted array may be in either buffer.
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "tests/gpu/simt/grid.h"

namespace cub {

template <typename T>
struct DoubleBuffer {
  DoubleBuffer(T* current, T* alternate) : buffers{current, alternate} {}
  T* Current() const { return buffers[selector]; }
  T* Alternate() const { return buffers[1 - selector]; }
  T* buffers[2];
  int selector = 0;
};

struct DeviceRadixSort {
  template <typename Key, typename Value, typename Count>
  static cudaError_t SortPairs(void* memory, size_t& bytes, DoubleBuffer<Key>& keys,
                               DoubleBuffer<Value>& values, Count count, int begin_bit, int end_bit,
                               cudaStream_t) {
    if (memory == nullptr) {
      bytes = 1;
      return cudaSuccess;
    }
    const int bits = end_bit - begin_bit;
    const Key mask = bits >= static_cast<int>(8 * sizeof(Key)) ? ~Key{0} : (Key{1} << bits) - 1;
    std::vector<size_t> order(static_cast<size_t>(count));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return (keys.Current()[a] >> begin_bit & mask) < (keys.Current()[b] >> begin_bit & mask);
    });
    for (size_t i = 0; i < order.size(); ++i) {
      keys.Alternate()[i] = keys.Current()[order[i]];
      values.Alternate()[i] = values.Current()[order[i]];
    }
    keys.selector = 1 - keys.selector;
    values.selector = 1 - values.selector;
    return cudaSuccess;
  }
};

}  // namespace cub
