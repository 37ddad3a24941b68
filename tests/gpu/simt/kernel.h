// The extensions of CUDA's language to C++, for kernels that grid.h runs: included before each of
// their sources. translate.py rewrites the rest, launches and dynamic shared memory, in C++.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "tests/gpu/simt/grid.h"

#define __host__
#define __device__
#define __global__
#define __grid_constant__
#define __launch_bounds__(...)
#define __forceinline__ inline
#define __shared__ static thread_local

#define threadIdx (::voxeld::simt::Here().thread)
#define blockIdx (::voxeld::simt::Here().block)
#define blockDim (::voxeld::simt::Here().block_size)
#define gridDim (::voxeld::simt::Here().grid_size)

using std::max;
using std::min;

// ------------------------------------------------------------------------------- blocks and warps

inline void __syncthreads() { voxeld::simt::WaitForBlock(false); }
inline int __syncthreads_or(int value) { return voxeld::simt::WaitForBlock(value != 0) ? 1 : 0; }
// A thread that sees the result of an atomicAdd also sees everything that happened before it.
inline void __threadfence() {}
inline void __syncwarp(uint32_t mask = 0xFFFFFFFFu) { voxeld::simt::Exchange(mask, 0); }
// Returns a set of lanes that happen to be together: at least the calling one.
inline uint32_t __activemask() { return 1u << voxeld::simt::Lane(); }

inline uint32_t __ballot_sync(uint32_t mask, int value) {
  const uint64_t* const values = voxeld::simt::Exchange(mask, value != 0);
  uint32_t bits = 0;
  for (uint32_t lane = 0; lane < 32; ++lane) {
    if ((mask >> lane & 1) != 0 && values[lane] != 0) bits |= 1u << lane;
  }
  return bits;
}
inline int __any_sync(uint32_t mask, int value) { return __ballot_sync(mask, value) != 0; }
inline int __all_sync(uint32_t mask, int value) { return __ballot_sync(mask, value) == mask; }

namespace voxeld::simt {
[[noreturn]] void AskedOfNobody(uint32_t mask, uint32_t lane);
template <typename T>
T ValueOf(uint32_t mask, T value, uint32_t lane) {
  static_assert(sizeof(T) <= sizeof(uint64_t));
  uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof(T));
  const uint64_t* const values = Exchange(mask, bits);
  if ((mask >> lane & 1) == 0) AskedOfNobody(mask, lane);
  std::memcpy(&value, &values[lane], sizeof(T));
  return value;
}
}  // namespace voxeld::simt

template <typename T>
T __shfl_sync(uint32_t mask, T value, uint32_t lane) {
  return voxeld::simt::ValueOf(mask, value, lane % 32);
}
template <typename T>
T __shfl_xor_sync(uint32_t mask, T value, uint32_t lanes) {
  return voxeld::simt::ValueOf(mask, value, voxeld::simt::Lane() ^ lanes);
}
template <typename T>
T __shfl_up_sync(uint32_t mask, T value, uint32_t lanes) {
  const uint32_t lane = voxeld::simt::Lane();
  return voxeld::simt::ValueOf(mask, value, lane >= lanes ? lane - lanes : lane);
}

// ----------------------------------------------------------------------------------------- memory

template <typename T>
T __ldg(const T* at) {
  return *at;
}
template <typename T>
T __ldcs(const T* at) {
  return *at;
}
template <typename T>
void __stcs(T* at, T value) {
  *at = value;
}

template <typename T, typename U>
T atomicAdd(T* at, U value) {
  return std::atomic_ref<T>(*at).fetch_add(static_cast<T>(value), std::memory_order_relaxed);
}
template <typename T, typename U>
T atomicSub(T* at, U value) {
  return std::atomic_ref<T>(*at).fetch_sub(static_cast<T>(value), std::memory_order_relaxed);
}
template <typename T, typename U>
T atomicOr(T* at, U value) {
  return std::atomic_ref<T>(*at).fetch_or(static_cast<T>(value), std::memory_order_relaxed);
}
template <typename T, typename U>
T atomicXor(T* at, U value) {
  return std::atomic_ref<T>(*at).fetch_xor(static_cast<T>(value), std::memory_order_relaxed);
}
template <typename T, typename U>
T atomicMax(T* at, U value) {
  std::atomic_ref<T> place(*at);
  T held = place.load(std::memory_order_relaxed);
  while (held < static_cast<T>(value) &&
         !place.compare_exchange_weak(held, static_cast<T>(value))) {
  }
  return held;
}
template <typename T, typename U>
T atomicMin(T* at, U value) {
  std::atomic_ref<T> place(*at);
  T held = place.load(std::memory_order_relaxed);
  while (held > static_cast<T>(value) &&
         !place.compare_exchange_weak(held, static_cast<T>(value))) {
  }
  return held;
}

// --------------------------------------------------------------------------------------- numbers

inline int __popc(uint32_t x) { return std::popcount(x); }
inline int __ffs(int x) { return __builtin_ffs(x); }
inline uint32_t __brev(uint32_t x) {
  uint32_t reversed = 0;
  for (int i = 0; i < 32; ++i) reversed |= (x >> i & 1) << (31 - i);
  return reversed;
}
inline uint32_t __byte_perm(uint32_t low, uint32_t high, uint32_t selector) {
  const uint64_t bytes = static_cast<uint64_t>(high) << 32 | low;
  uint32_t picked = 0;
  for (int i = 0; i < 4; ++i) {
    const uint32_t byte = static_cast<uint32_t>(bytes >> (8 * (selector >> 4 * i & 7))) & 0xFF;
    picked |= byte << 8 * i;
  }
  return picked;
}
inline uint32_t __funnelshift_l(uint32_t low, uint32_t high, uint32_t shift) {
  const uint64_t both = static_cast<uint64_t>(high) << 32 | low;
  return static_cast<uint32_t>(both << (shift & 31) >> 32);
}
inline uint32_t __vimin3_u32(uint32_t a, uint32_t b, uint32_t c) { return min(min(a, b), c); }
inline uint32_t __float_as_uint(float x) { return std::bit_cast<uint32_t>(x); }
inline int __float_as_int(float x) { return std::bit_cast<int>(x); }
inline float __int2float_rn(int x) { return static_cast<float>(x); }
// If the exponents of the addends are not too far apart, the sum in double is exact; otherwise it
// is on the right side.
inline float __fadd_rd(float a, float b) {
  const double sum = static_cast<double>(a) + static_cast<double>(b);
  const float near = static_cast<float>(sum);
  return static_cast<double>(near) > sum ? std::nextafter(near, -INFINITY) : near;
}
