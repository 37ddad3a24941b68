// Grids of CUDA threads on the CPU: a kernel, compiled as C++ (translate.py, kernel.h), is run with
// CUDA's rules for threads that wait for each other, and with none of the habits of real devices that
// a kernel must not lean on.
//
// A thread of the grid is a fiber, and goes on until it has to wait: for its block, or for lanes of its
// warp. Which one goes on next is drawn by lot, so that what is not ordered by a barrier comes in any
// order. Blocks run side by side on two threads of the processor. Shared memory is not cleared
// between blocks, device memory not at all.
//
// What CUDA leaves undefined ends the program with a message: a barrier that some threads of a block
// never reach, lanes that wait for lanes that have ended or for others than these wait for, a value
// asked of a lane that does not take part.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <tuple>
#include <type_traits>
#include <utility>

#include "cuda_runtime_api.h"

namespace voxeld::simt {

// Where the thread that runs is.
struct Place {
  dim3 thread, block, block_size, grid_size;
};
const Place& Here();

// For the kernels' part (kernel.h).
uint32_t Lane();
void* DynamicShared();
// What every thread of the block gives, or-ed, once all have come.
bool WaitForBlock(bool value);
// What the lanes of `mask` give: of the others nothing is said. All of them call it with one mask.
const uint64_t* Exchange(uint32_t mask, uint64_t value);
// Work that is done when the thread waits for it (or never).
void Later(std::function<void()> work);
void DoLater();

struct Grid {
  dim3 blocks, threads;
  size_t shared = 0;
  const void* kernel = nullptr;
};
// Runs body() in each thread of the grid, if that can be; else the next cudaGetLastError() tells.
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
