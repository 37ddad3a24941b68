#include "gpu/worker/no_cuda_engine.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace voxeld::gpu {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

TEST(NoCudaEngine, TheMessageSaysHowToGetTheEngine) {
  for (const bool gpu_is_visible : {false, true}) {
    const absl::Status status = NoCudaEngine(gpu_is_visible);
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_THAT(status.message(), HasSubstr("CUDA engine"));
    EXPECT_THAT(status.message(), HasSubstr("the package voxeld-cuda"));
    EXPECT_THAT(status.message(), HasSubstr("nvcc and"));
    EXPECT_THAT(status.message(), HasSubstr("-DVOXELD_CUDA=ON"));
  }
}

TEST(NoCudaEngine, TheMessageSaysWhetherThereIsAGpu) {
  EXPECT_THAT(std::string(NoCudaEngine(true).message()), StartsWith("there is a GPU"));
  EXPECT_THAT(std::string(NoCudaEngine(false).message()), StartsWith("no GPU is visible"));
}

TEST(GpuIsVisible, NotByOtherFilesOfTheDriver) {
  const std::filesystem::path root =
      std::filesystem::path(testing::TempDir()) / "voxeld_gpu_no_gpu";
  std::filesystem::remove_all(root);
  for (const char* const folder : {"proc/driver/nvidia/gpus", "dev"}) {
    std::filesystem::create_directories(root / folder);
  }
  for (const char* const name : {"nvidiactl", "nvidia-uvm", "nvidia", "null"}) {
    std::ofstream(root / "dev" / name) << "\n";
  }
  EXPECT_FALSE(GpuIsVisible(root.string()));
  std::filesystem::remove_all(root);
}

TEST(GpuIsVisible, ByTheDriverOrTheDevice) {
  for (const char* const path :
       {"/proc/driver/nvidia/gpus/0000:01:00.0", "/dev/nvidia0", "/dev/nvidia3", "/dev/nvidia12"}) {
    const std::filesystem::path root =
        std::filesystem::path(testing::TempDir()) / "voxeld_gpu_is_visible";
    std::filesystem::remove_all(root);
    EXPECT_FALSE(GpuIsVisible(root.string()));
    const std::filesystem::path file = root.string() + path;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file) << "\n";
    EXPECT_TRUE(GpuIsVisible(root.string())) << path;
    std::filesystem::remove_all(root);
  }
}

}  // namespace
}  // namespace voxeld::gpu
