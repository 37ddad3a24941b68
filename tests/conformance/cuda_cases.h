// The CUDA engine in this process, with several tunings.
#pragma once

#include <string>
#include <vector>

#include "gpu/cuda/cuda_engine.h"
#include "tests/conformance/engine_cases.h"

namespace voxeld::gpu::conformance {

// Returns one case, or, unless `few`, one for each way of drawing. `formulas` is for the first; the
// others compile none.
inline std::vector<EngineCase> CudaCases(const std::string& name, bool few,
                                         cuda::CompileFormulas formulas) {
  const auto tuned = [&](const char* how, const cuda::Tuning& tuning) {
    return EngineCase{name + how, [tuning](const EngineOptions& options) {
                        return CreateCudaEngine(options, "a test", {}, tuning);
                      }};
  };
  cuda::Tuning plain;
  plain.compile_formulas = formulas;
  // With groups, as large scenes have.
  cuda::Tuning groups;
  groups.few_items = 0;
  groups.group_bytes = 1;
  groups.few_lines = groups.few_points = 0;
  groups.points_each = 1;
  groups.least_crowd = 1;
  groups.compile_formulas = cuda::CompileFormulas::kNever;
  // Without any list; and without lists that are kept.
  cuda::Tuning tight = groups, passes = groups;
  passes.points_each = 4;
  tight.index_bytes = 1;
  passes.index_bytes = 1 << 20;
  passes.index_share_kept = 0;
  if (few) return {tuned("", plain), tuned("_passes", passes)};
  return {tuned("", plain), tuned("_groups", groups), tuned("_tight", tight),
          tuned("_passes", passes)};
}

}  // namespace voxeld::gpu::conformance
