#include "gpu/engine.h"

#include <gmock/gmock.h>

namespace voxeld::gpu {
namespace {

TEST(CreateEngine, AutoTakesTheCpuAndSaysWhyWhereThereIsNothingElse) {
  const absl::StatusOr<std::unique_ptr<Engine>> engine =
      CreateEngine({.threads = 3, .worker = "/nowhere/voxeld-engine"});
  ASSERT_TRUE(engine.ok());
  EXPECT_EQ((*engine)->info().kind, EngineKind::kCpu);
  EXPECT_EQ((*engine)->info().device, "CPU, 3 threads");
  EXPECT_THAT((*engine)->info().reason,
              testing::HasSubstr("/nowhere/voxeld-engine cannot be started"));
}

TEST(CreateEngine, CpuIsAskedFor) {
  const absl::StatusOr<std::unique_ptr<Engine>> engine =
      CreateEngine({.kind = EngineKind::kCpu, .threads = 1});
  ASSERT_TRUE(engine.ok());
  EXPECT_EQ((*engine)->info().reason, "asked for");
  EXPECT_EQ((*engine)->info().device, "CPU, 1 thread");
}

TEST(CreateEngine, CudaIsRefusedWithTheReason) {
  const absl::Status status =
      CreateEngine({.kind = EngineKind::kCuda, .worker = "/nowhere/voxeld-engine"}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), testing::HasSubstr("/nowhere/voxeld-engine cannot be started"));
}

TEST(EngineKindName, NamesEach) {
  EXPECT_STREQ(EngineKindName(EngineKind::kAuto), "auto");
  EXPECT_STREQ(EngineKindName(EngineKind::kCpu), "cpu");
  EXPECT_STREQ(EngineKindName(EngineKind::kCuda), "cuda");
}

}  // namespace
}  // namespace voxeld::gpu
