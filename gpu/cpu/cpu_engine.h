// The engine on the CPU.
#pragma once

#include <memory>
#include <string>

#include "gpu/engine.h"

namespace voxeld::gpu {

// `reason` is for EngineInfo. Ignores `options.kind`.
std::unique_ptr<Engine> CreateCpuEngine(const EngineOptions& options, std::string reason);

}  // namespace voxeld::gpu
