// Every engine that must pass the conformance suite: one line each.
#pragma once

#include <string>
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
            options.worker_deadline_ns =
                int64_t{60} * 1'000'000'000;  // of a slow machine, or a sanitizer
            options.devices = devices;
            return CreateEngine(options);
          }};
}

#if defined(VOXELD_TEST_CUDA) || defined(VOXELD_TEST_SIMT)
// The CUDA engine in this process; unless `few`, each of its ways by itself.
inline std::vector<EngineCase> CudaCases(const std::string& name, bool few) {
  const auto tuned = [&](const char* how, const cuda::Tuning& tuning) {
    return EngineCase{name + how, [tuning](const EngineOptions& options) {
                        return CreateCudaEngine(options, "a test", {}, tuning);
                      }};
  };
  cuda::Tuning plain;
#if defined(VOXELD_TEST_SIMT)  // no device takes what would be compiled
  plain.compile_formulas = cuda::CompileFormulas::kNever;
#endif
  // In groups, as large scenes are.
  cuda::Tuning groups;
  groups.few_items = 0;
  groups.group_bytes = 1;
  groups.few_lines = groups.few_points = 0;
  groups.points_each = 1;
  groups.least_crowd = 1;
  groups.compile_formulas = cuda::CompileFormulas::kNever;
  // With no list at all; and with none that stays.
  cuda::Tuning tight = groups, passes = groups;
  passes.points_each = 4;
  tight.index_bytes = 1;
  passes.index_bytes = 1 << 20;
  passes.index_share_kept = 0;
  if (few) return {tuned("", plain), tuned("_passes", passes)};
  return {tuned("", plain), tuned("_groups", groups), tuned("_tight", tight),
          tuned("_passes", passes)};
}
#endif

inline std::vector<EngineCase> EngineCases() {
#if defined(VOXELD_TEST_CUDA)  // a program of its own, for machines with a GPU
  std::vector<EngineCase> cases = CudaCases("cuda", false);
  // With formulas that are compiled before anything is drawn.
  cases.push_back({"cuda_formulas", [](const EngineOptions& options) {
                     return CreateCudaEngine(options, "a test", {},
                                             {.compile_formulas = cuda::CompileFormulas::kAtOnce});
                   }});
  cases.push_back(CaseOf("cuda_worker", EngineKind::kCuda, true));
  return cases;
#elif defined(VOXELD_TEST_SIMT_FEW)  // with a CPU for a GPU
  return CudaCases("cuda_simt", true);
#elif defined(VOXELD_TEST_SIMT)
  return CudaCases("cuda_simt", false);
#else
  return {
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
  };
#endif
}

}  // namespace voxeld::gpu::conformance
