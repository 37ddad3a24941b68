#include "tests/conformance/engine_cases.h"

namespace voxeld::gpu::conformance {

std::vector<EngineCase> EngineCases() {
  return {
      CaseOf("cpu", EngineKind::kCpu, false),
      // Draws most of a scene in passes of few items.
      {"cpu_tight",
       [](EngineOptions options) {
         options.kind = EngineKind::kCpu;
         options.index_bytes = 1 << 16;
         return CreateEngine(options);
       }},
      // Keeps most of a scene out of the lists.
      {"cpu_unlisted",
       [](EngineOptions options) {
         options.kind = EngineKind::kCpu;
         options.index_bytes = 4096;
         return CreateEngine(options);
       }},
      CaseOf("cpu_worker", EngineKind::kCpu, true),
      CaseOf("cpu_ranks", EngineKind::kCpu, true, {0, 1}),
  };
}

}  // namespace voxeld::gpu::conformance
