#include "gpu/engine.h"

#include <gtest/gtest.h>

namespace voxeld::gpu {
namespace {

TEST(CreateEngine, AutoAlwaysSucceedsAndSaysWhy) {
  const absl::StatusOr<std::unique_ptr<Engine>> engine = CreateEngine({.threads = 3});
  ASSERT_TRUE(engine.ok());
  EXPECT_EQ((*engine)->info().kind, EngineKind::kCpu);
  EXPECT_EQ((*engine)->info().device, "CPU, 3 threads");
  EXPECT_NE((*engine)->info().reason, "");
}

TEST(CreateEngine, CpuIsAskedFor) {
  const absl::StatusOr<std::unique_ptr<Engine>> engine =
      CreateEngine({.kind = EngineKind::kCpu, .threads = 1});
  ASSERT_TRUE(engine.ok());
  EXPECT_EQ((*engine)->info().reason, "asked for");
  EXPECT_EQ((*engine)->info().device, "CPU, 1 thread");
}

TEST(CreateEngine, CudaIsRefusedWithTheReason) {
  const absl::Status status = CreateEngine({.kind = EngineKind::kCuda}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(status.message(), "this build has no CUDA engine");
}

TEST(EngineKindName, NamesEach) {
  EXPECT_STREQ(EngineKindName(EngineKind::kAuto), "auto");
  EXPECT_STREQ(EngineKindName(EngineKind::kCpu), "cpu");
  EXPECT_STREQ(EngineKindName(EngineKind::kCuda), "cuda");
}

}  // namespace
}  // namespace voxeld::gpu
