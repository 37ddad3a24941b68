// The answers of a build without the CUDA engine when that engine is requested.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace voxeld::gpu {

// Returns whether the kernel has a driver for an NVIDIA GPU, from the files that it creates for
// one. `root`: the directory that replaces /.
bool GpuIsVisible(const std::string& root = "");

// Returns FailedPrecondition with a message that says how to get the CUDA engine. It becomes the
// reason why the CPU draws (EngineInfo::reason), which the daemon logs for each display.
absl::Status NoCudaEngine(bool gpu_is_visible);

}  // namespace voxeld::gpu
