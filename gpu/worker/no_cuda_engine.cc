#include "gpu/worker/no_cuda_engine.h"

#include <unistd.h>

namespace voxeld::gpu {

bool GpuIsVisible(const std::string& root) {
  // A container may have the device alone.
  for (const char* path : {"/proc/driver/nvidia/version", "/dev/nvidia0"}) {
    if (access((root + path).c_str(), F_OK) == 0) return true;
  }
  return false;
}

absl::Status NoCudaEngine(bool gpu_is_visible) {
  return absl::FailedPreconditionError(
      gpu_is_visible
          ? "there is a GPU, but this build has no CUDA engine; configure with -DVOXELD_CUDA=ON"
          : "no GPU is visible, and this build has no CUDA engine; to have it all the same, "
            "configure with -DVOXELD_CUDA=ON");
}

}  // namespace voxeld::gpu
