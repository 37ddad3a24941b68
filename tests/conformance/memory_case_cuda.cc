// For machines with a GPU that nothing else uses at the same time.
#include <cuda_runtime_api.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include "gpu/cuda/cuda_engine.h"
#include "tests/conformance/memory_case.h"

namespace voxeld::gpu::conformance {
namespace {

// Kernels are loaded with the context, not when they first run: their memory does not belong to a
// scene.
const bool kLoadedAtOnce = setenv("CUDA_MODULE_LOADING", "EAGER", 1) == 0;

}  // namespace

MemoryCase MeasuredEngine() {
  EXPECT_TRUE(kLoadedAtOnce);
  return {.engine = {"cuda",
                     [](const EngineOptions& options) {
                       return CreateCudaEngine(options, "a test", {},
                                               {.compile_formulas = cuda::CompileFormulas::kNever});
                     }},
          .drawables = 10'000,
          .dots = 300'000,
          .kept_bytes = 80 << 20};
}

uint64_t DeviceBytes() {
  size_t free = 0, total = 0;
  EXPECT_EQ(cudaMemGetInfo(&free, &total), cudaSuccess);
  return total - free;
}

}  // namespace voxeld::gpu::conformance
