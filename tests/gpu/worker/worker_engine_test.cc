// What an engine's owner sees when its worker fails.
#include "gpu/worker/worker_engine.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/conformance/engine_driver.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;

class FaultyWorker : public ::testing::Test {
 protected:
  ~FaultyWorker() override { unsetenv("VOXELD_TEST_FAULT"); }

  conformance::EngineDriver Make(const char* fault, int64_t deadline_ns = 20'000'000'000) {
    setenv("VOXELD_TEST_FAULT", fault, 1);
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.threads = 1;
    options.in_worker = true;
    options.worker = FAULTY_ENGINE;
    options.worker_deadline_ns = deadline_ns;
    return {{"faulty", [](const EngineOptions& o) { return CreateEngine(o); }}, options};
  }

  conformance::SceneGenerator generator_{7};
  const Target target_ = generator_.RandomTarget();
};

TEST_F(FaultyWorker, ThatCrashesEndsThisCallAndEveryLaterOneInDataLoss) {
  for (const char* fault : {"crash:2", "exit:2"}) {
    SCOPED_TRACE(fault);
    conformance::EngineDriver engine = Make(fault);
    ASSERT_TRUE(engine.SetTarget(target_).ok());
    ASSERT_TRUE(engine.Frame().ok());
    const absl::Status lost = engine.Frame().status();
    EXPECT_EQ(lost.code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(lost.message(), HasSubstr("the worker was lost"));
    EXPECT_EQ(engine.Frame().status().code(), absl::StatusCode::kDataLoss);
    EXPECT_EQ(engine.SetTarget(target_).code(), absl::StatusCode::kDataLoss);
    conformance::DeltaBuffer delta;
    delta.Reset();
    EXPECT_EQ(engine.Apply(delta).code(), absl::StatusCode::kDataLoss);
  }
}

TEST_F(FaultyWorker, ThatHangsIsGivenUp) {
  conformance::EngineDriver engine = Make("hang:1", 100'000'000);
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  const absl::Status lost = engine.Frame().status();
  EXPECT_EQ(lost.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(lost.message(), HasSubstr("did not answer in time"));
  EXPECT_EQ(engine.Frame().status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(FaultyWorker, ThatHangsDoesNotHoldUpItsOwnersEnd) {
  std::promise<absl::Status> answer;
  std::vector<std::byte> bytes(target_.layout.bytes());
  std::vector<uint64_t> numbers(target_.layout.pictures());
  {
    conformance::EngineDriver engine = Make("hang:1");
    ASSERT_TRUE(engine.SetTarget(target_).ok());
    engine.engine().SubmitFrame({1, 0}, {bytes, numbers}, [&](absl::StatusOr<FrameResult> result) {
      answer.set_value(result.status());
    });
  }
  EXPECT_EQ(answer.get_future().get().code(), absl::StatusCode::kCancelled);
}

TEST(WorkerEngine, APromisedProgramMustBeThereAndBeAWorker) {
  EngineOptions options;
  options.kind = EngineKind::kCpu;
  options.worker = "/nowhere/engine";
  absl::Status status = CreateWorkerEngine(options, "").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("/nowhere/engine cannot be started"));
  options.worker = "/bin/true";
  status = CreateWorkerEngine(options, "").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
}

TEST(DefaultWorkerProgram, IsTheNearestThatIsThere) {
  namespace fs = std::filesystem;
  const fs::path root =
      fs::path(::testing::TempDir()) / ("voxeld_worker_program_" + std::to_string(getpid()));
  const fs::path running = root / "usr/bin/voxeld";
  const fs::path installed = root / "usr/libexec/voxeld/voxeld-engine";
  EXPECT_EQ(DefaultWorkerProgram(running), installed) << "what a message names if none is there";
  for (const fs::path& nearer :
       {installed, root / "usr/voxeld-engine", root / "usr/bin/voxeld-engine"}) {
    fs::create_directories(nearer.parent_path());
    std::ofstream(nearer) << "a program";
    EXPECT_EQ(DefaultWorkerProgram(running), nearer);
  }
  fs::remove_all(root);
}

}  // namespace
}  // namespace voxeld::gpu
