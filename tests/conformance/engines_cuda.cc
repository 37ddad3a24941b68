// The engines of a separate program, for machines with a GPU.
#include "tests/conformance/cuda_cases.h"

namespace voxeld::gpu::conformance {

std::vector<EngineCase> EngineCases() {
  std::vector<EngineCase> cases = CudaCases("cuda", false, cuda::Tuning().compile_formulas);
  // With formulas that are compiled before anything is drawn.
  cases.push_back({"cuda_formulas", [](const EngineOptions& options) {
                     return CreateCudaEngine(options, "a test", {},
                                             {.compile_formulas = cuda::CompileFormulas::kAtOnce});
                   }});
  cases.push_back(CaseOf("cuda_worker", EngineKind::kCuda, true));
  return cases;
}

}  // namespace voxeld::gpu::conformance
