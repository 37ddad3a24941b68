#include "gpu/cuda/formula_source.h"

#include "absl/strings/str_cat.h"
#include "gpu/implicit/formula_text.h"

namespace voxeld::gpu::cuda {

std::string FormulaSource(std::span<const uint32_t> hoisted) {
  return absl::StrCat(R"(#include "gpu/cuda/covered-inl.h"
namespace voxeld::gpu::implicit {
)",
                      implicit::FormulaText(hoisted), R"(
}  // namespace voxeld::gpu::implicit
namespace voxeld::gpu::cuda {
extern "C" __global__ void __launch_bounds__(kCoveredThreads, kCoveredBlocks)
    )",
                      kFormulaKernel, R"((const __grid_constant__ CoveredViews views) {
  __shared__ CoveredScratch scratch;
  FindCoveredItems<CompiledFormula<implicit::Formula>>(views.at(blockIdx.y), {}, scratch);
}
}  // namespace voxeld::gpu::cuda
)");
}

}  // namespace voxeld::gpu::cuda
