// With a CPU in place of a GPU. No device can run compiled formulas.
#include "tests/conformance/cuda_cases.h"

namespace voxeld::gpu::conformance {

std::vector<EngineCase> EngineCases() {
  return CudaCases("cuda_simt", false, cuda::CompileFormulas::kNever);
}

}  // namespace voxeld::gpu::conformance
