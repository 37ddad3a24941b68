// Every engine that must pass the conformance suite: one line each.
#pragma once

#include <vector>

#if defined(VOXELD_TEST_CUDA)
#include "gpu/cuda/cuda_engine.h"
#endif
#include "tests/conformance/engine_driver.h"

namespace voxeld::gpu::conformance {

inline std::vector<EngineCase> EngineCases() {
  return {
#if defined(VOXELD_TEST_CUDA)  // a program of its own, for machines with a GPU
    {"cuda", [](const EngineOptions& options) { return CreateCudaEngine(options, "a test"); }},
#else
    {"cpu", [](EngineOptions options) {
       options.kind = EngineKind::kCpu;
       return CreateEngine(options);
     }},
#endif
  };
}

}  // namespace voxeld::gpu::conformance
