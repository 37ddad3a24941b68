#include "gpu/cuda/cuda_engine.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "gpu/core_engine.h"
#include "gpu/cuda/cuda_core.h"
#include "gpu/cuda/draw_kernels.h"
#include "gpu/cuda/nvrtc.h"

namespace voxeld::gpu {

absl::StatusOr<std::unique_ptr<Engine>> CreateCudaEngine(const EngineOptions& options,
                                                         std::string reason,
                                                         const cuda::FaultPlan& faults,
                                                         const cuda::Tuning& tuning) {
  absl::StatusOr<std::unique_ptr<cuda::Device>> device = cuda::Device::Open(options.device);
  if (!device.ok()) return device.status();
  const cudaDeviceProp& properties = (*device)->api().device();
  if (properties.sharedMemPerBlockOptin < cuda::DrawShared()) {
    return absl::FailedPreconditionError(absl::StrCat(
        properties.name, " gives a block of threads ", properties.sharedMemPerBlockOptin,
        " bytes of shared memory; drawing takes ", cuda::DrawShared()));
  }
  (*device)->api().SetFaults(faults);
  if (tuning.compile_formulas != cuda::CompileFormulas::kNever) {
    const absl::Status compiler = cuda::Nvrtc::OpenFor(properties.major, properties.minor).status();
    if (!compiler.ok()) {
      absl::StrAppend(&reason, "; expressions are interpreted: ", compiler.message());
    }
  }
  const EngineInfo info = {EngineKind::kCuda, (*device)->api().device().name, std::move(reason)};
  cuda::Tuning chosen = tuning;
  if (options.index_bytes != 0) chosen.index_bytes = options.index_bytes;
  auto core = std::make_unique<cuda::CudaCore>(*std::move(device), options.part, chosen);
  return std::make_unique<CoreEngine<cuda::CudaCore>>(options, info, std::move(core));
}

}  // namespace voxeld::gpu
