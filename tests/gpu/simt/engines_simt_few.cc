// With a CPU in place of a GPU: not each of the engine's ways by itself. No device can run compiled
// formulas.
#include "tests/conformance/cuda_cases.h"

namespace voxeld::gpu::conformance {

std::vector<EngineCase> EngineCases() {
  return CudaCases("cuda_simt", true, cuda::CompileFormulas::kNever);
}

}  // namespace voxeld::gpu::conformance
