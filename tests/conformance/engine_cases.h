// Every engine that must pass the conformance suite: one line each.
#pragma once

#include <vector>

#if defined(VOXELD_TEST_CUDA) || defined(VOXELD_TEST_SIMT)
#include "gpu/cuda/cuda_engine.h"
#endif
#include "tests/conformance/engine_driver.h"

namespace voxeld::gpu::conformance {

// Of CreateEngine; with `in_worker` in a process of its own.
inline EngineCase CaseOf(const char* name, EngineKind kind, bool in_worker,
                         const std::vector<int>& devices = {}) {
  return {name, [kind, in_worker, devices](EngineOptions options) {
            options.kind = kind;
            options.in_worker = in_worker;
            options.devices = devices;
            return CreateEngine(options);
          }};
}

inline std::vector<EngineCase> EngineCases() {
  return {
#if defined(VOXELD_TEST_CUDA)  // a program of its own, for machines with a GPU
    {"cuda", [](const EngineOptions& options) { return CreateCudaEngine(options, "a test"); }},
        // In groups, as large scenes are.
        {"cuda_groups",
         [](const EngineOptions& options) {
           return CreateCudaEngine(options, "a test", {},
                                   {.few_items = 0, .group_bytes = 1, .few_lines = 0});
         }},
        // With no list at all; and with none that stays.
        {"cuda_tight",
         [](const EngineOptions& options) {
           return CreateCudaEngine(
               options, "a test", {},
               {.few_items = 0, .group_bytes = 1, .few_lines = 0, .index_bytes = 1});
         }},
        {"cuda_passes",
         [](const EngineOptions& options) {
           return CreateCudaEngine(options, "a test", {},
                                   {.few_items = 0,
                                    .group_bytes = 1,
                                    .few_lines = 0,
                                    .index_bytes = 1 << 20,
                                    .index_share_kept = 0});
         }},
        CaseOf("cuda_worker", EngineKind::kCuda, true),
#elif defined(VOXELD_TEST_SIMT)  // with a CPU for a GPU
#if !defined(VOXELD_TEST_SIMT_FEW)
    {"cuda_simt", [](const EngineOptions& options) { return CreateCudaEngine(options, "a test"); }},
#endif
        // In groups, as large scenes are.
        {"cuda_simt_groups",
         [](const EngineOptions& options) {
           return CreateCudaEngine(options, "a test", {},
                                   {.few_items = 0, .group_bytes = 1, .few_lines = 0});
         }},
    // With no list at all; and with none that stays.
#if !defined(VOXELD_TEST_SIMT_FEW)
        {"cuda_simt_tight",
         [](const EngineOptions& options) {
           return CreateCudaEngine(
               options, "a test", {},
               {.few_items = 0, .group_bytes = 1, .few_lines = 0, .index_bytes = 1});
         }},
#endif
        {"cuda_simt_passes", [](const EngineOptions& options) {
           return CreateCudaEngine(options, "a test", {},
                                   {.few_items = 0,
                                    .group_bytes = 1,
                                    .few_lines = 0,
                                    .index_bytes = 1 << 20,
                                    .index_share_kept = 0});
         }},
#else
    CaseOf("cpu", EngineKind::kCpu, false),
        // All of a scene in passes, of few items.
        {"cpu_tight",
         [](EngineOptions options) {
           options.kind = EngineKind::kCpu;
           options.index_bytes = 4096;
           return CreateEngine(options);
         }},
        CaseOf("cpu_worker", EngineKind::kCpu, true),
        CaseOf("cpu_ranks", EngineKind::kCpu, true, {0, 1}),
#endif
  };
}

}  // namespace voxeld::gpu::conformance
