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
    EXPECT_THAT(status.message(), HasSubstr("this build has no CUDA engine"));
    EXPECT_THAT(status.message(), HasSubstr("configure with -DVOXELD_CUDA=ON"));
  }
}

TEST(NoCudaEngine, TheMessageSaysWhetherThereIsAGpu) {
  EXPECT_THAT(std::string(NoCudaEngine(true).message()), StartsWith("there is a GPU"));
  EXPECT_THAT(std::string(NoCudaEngine(false).message()), StartsWith("no GPU is visible"));
}

TEST(GpuIsVisible, ByTheDriverOrTheDevice) {
  for (const char* const path : {"/proc/driver/nvidia/version", "/dev/nvidia0"}) {
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
