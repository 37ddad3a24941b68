#include "gpu/worker/no_cuda_engine.h"

#include <filesystem>
#include <string>
#include <system_error>

namespace voxeld::gpu {

bool GpuIsVisible(const std::string& root) {
  // A container may have a device without the driver's folder, and not the first one.
  // cmake/VoxeldCuda.cmake checks the same places.
  std::error_code ignored;
  const std::filesystem::directory_iterator gpus(root + "/proc/driver/nvidia/gpus", ignored);
  if (gpus != std::filesystem::directory_iterator()) return true;
  for (const auto& entry : std::filesystem::directory_iterator(root + "/dev", ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.size() > 6 && name.starts_with("nvidia") && name[6] >= '0' && name[6] <= '9')
      return true;
  }
  return false;
}

absl::Status NoCudaEngine(bool gpu_is_visible) {
  return absl::FailedPreconditionError(
      gpu_is_visible
          ? "there is a GPU, but this build has no CUDA engine; install the package voxeld-cuda, "
            "or "
            "install nvcc and configure with -DVOXELD_CUDA=ON"
          : "no GPU is visible, and the CUDA engine is not installed; the package voxeld-cuda has "
            "it, and so have builds with nvcc and -DVOXELD_CUDA=ON");
}

}  // namespace voxeld::gpu
