// The engine on a CUDA device, in this process.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "gpu/cuda/api.h"
#include "gpu/cuda/tuning.h"
#include "gpu/engine.h"

namespace voxeld::gpu {

// `reason`: for EngineInfo. Errors: FailedPrecondition if no device is usable.
absl::StatusOr<std::unique_ptr<Engine>> CreateCudaEngine(const EngineOptions& options,
                                                         std::string reason,
                                                         const cuda::FaultPlan& faults = {},
                                                         const cuda::Tuning& tuning = {});

}  // namespace voxeld::gpu
