// Runs grids of CUDA threads on the CPU: a kernel, compiled as C++ (translate.py, kernel.h), runs
// with CUDA's rules for threads that wait for each other, and without the habits of real devices on
// which a kernel must not rely.
//
// A thread of the grid is a fiber, and runs until it has to wait: for its block, or for lanes of
// its warp. The next one is chosen at random, so that everything that is not ordered by a barrier
// happens in any order. Blocks run side by side on two threads of the processor. Shared memory is
// not cleared between blocks, and device memory is not cleared at all.
//
// Behaviour that CUDA leaves undefined terminates the program with a message: a barrier that some
// threads of a block never reach, lanes that wait for lanes that have ended or that wait for other
// lanes, a value requested from a lane that does not take part.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <tuple>
#include <type_traits>
#include <utility>

#include "cuda_runtime_api.h"

namespace voxeld::simt {

// The position of the running thread.
struct Place {
  dim3 thread, block, block_size, grid_size;
};
const Place& Here();

// For use by kernels (kernel.h).
uint32_t Lane();
void* DynamicShared();
// Returns the values of all threads of the block, or-ed, once all have arrived.
bool WaitForBlock(bool value);
// Returns the values of the lanes of `mask`; those of others are unspecified. All of them must call
// it with the same mask.
const uint64_t* Exchange(uint32_t mask, uint64_t value);
// Defers work until the thread waits for it (possibly never).
void Later(std::function<void()> work);
void DoLater();

struct Grid {
  dim3 blocks, threads;
  size_t shared = 0;
  const void* kernel = nullptr;
};
// Runs body() in each thread of the grid, if that is possible; otherwise the next
// cudaGetLastError() reports the error.
void Run(const Grid& grid, const std::function<void()>& body);

// kernel<<<blocks, threads, shared, stream>>>(…)
template <typename... Parameters>
auto Launch(void (*kernel)(Parameters...), dim3 blocks, dim3 threads, size_t shared = 0,
            cudaStream_t = nullptr) {
  const Grid grid{blocks, threads, shared, reinterpret_cast<const void*>(kernel)};
  return [grid, kernel](auto&&... arguments) {
    const std::tuple<std::remove_const_t<Parameters>...> values(
        std::forward<decltype(arguments)>(arguments)...);
    Run(grid, [&] { std::apply(kernel, values); });
  };
}

}  // namespace voxeld::simt
