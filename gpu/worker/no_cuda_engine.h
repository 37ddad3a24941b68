// What a build without the CUDA engine answers when it is asked for one.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace voxeld::gpu {

// Whether the kernel has a driver for an NVIDIA GPU, by the files that it makes for one. `root`: where / is.
bool GpuIsVisible(const std::string& root = "");

// FailedPrecondition; the message says how to get the CUDA engine. It becomes the reason why the CPU draws
// (EngineInfo::reason), which the daemon logs for each display.
absl::Status NoCudaEngine(bool gpu_is_visible);

}  // namespace voxeld::gpu
