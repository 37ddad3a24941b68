// Tests what an engine's owner sees when its worker fails.
#include "gpu/worker/worker_engine.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <future>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gpu/worker/process.h"
#include "gpu/worker/worker_pool.h"
#include "tests/conformance/engine_driver.h"
#include "tests/conformance/scene_generator.h"
#include "tests/gpu/worker/fault_environment.h"
#include "tests/programs.h"

namespace voxeld::gpu {
namespace {

using ::testing::HasSubstr;

class FaultyWorker : public ::testing::Test {
 protected:
  // `fault`: its kind and, after a colon, its frame.
  conformance::EngineDriver Make(const std::string& fault, int64_t deadline_ns = 20'000'000'000) {
    const size_t colon = fault.find(':');
    return MakeWith({.frame = fault.substr(colon + 1), .kind = fault.substr(0, colon)},
                    deadline_ns);
  }
  static conformance::EngineDriver MakeWith(const FaultEnvironment::Fault& fault,
                                            int64_t deadline_ns = 20'000'000'000) {
    const FaultEnvironment environment(fault);
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.threads = 1;
    options.in_worker = true;
    options.worker = ProgramBeside("faulty_engine");
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

TEST_F(FaultyWorker, ThatLiesIsNotBelieved) {
  const std::vector<std::pair<const char*, const char*>> lies = {
      {"call", ", of which no answer is owed"},
      {"type", "the worker's answer to a frame is none"},
      {"short", "the worker's answer to a frame is none"},
      {"frame", "the worker answered with another frame"},
      {"sum", "a frame was damaged on its way from the worker"},
      {"done", "a frame without a result"}};
  for (const auto& [lie, what] : lies) {
    SCOPED_TRACE(lie);
    conformance::EngineDriver engine = MakeWith({.lie = lie});
    ASSERT_TRUE(engine.SetTarget(target_).ok());
    const absl::Status refused = engine.Frame().status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kDataLoss) << refused;
    EXPECT_THAT(refused.message(), HasSubstr(what));
  }
  conformance::EngineDriver honest = MakeWith({.lie = "not at all"});
  ASSERT_TRUE(honest.SetTarget(target_).ok());
  EXPECT_TRUE(honest.Frame().ok()) << "the liar passes on true answers";
}

TEST_F(FaultyWorker, ThatHangsIsGivenUp) {
  conformance::EngineDriver engine = Make("hang:1", 2'000'000'000);
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

// ---- several engines in one process

class SharedWorker : public FaultyWorker {
 protected:
  EngineOptions Options() {
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.threads = 1;
    options.in_worker = true;
    options.worker = ProgramBeside("faulty_engine");
    options.worker_deadline_ns = 20'000'000'000;
    options.workers = pool_;
    return options;
  }
  static conformance::EngineDriver Drive(const EngineOptions& options) {
    return {{"shared", [](const EngineOptions& o) { return CreateEngine(o); }}, options};
  }
  pid_t Process() {
    return (*pool_->Acquire(ProgramBeside("faulty_engine"), EngineKind::kCpu, 0))->pid();
  }

  const std::shared_ptr<WorkerPool> pool_ = std::make_shared<WorkerPool>();
};

TEST_F(SharedWorker, ServesAllEnginesAndOutlivesEach) {
  conformance::EngineDriver a = Drive(Options());
  const pid_t process = Process();
  {
    conformance::EngineDriver b = Drive(Options());
    EXPECT_EQ(Process(), process);
    ASSERT_TRUE(a.SetTarget(target_).ok());
    ASSERT_TRUE(b.SetTarget(target_).ok());
    ASSERT_TRUE(a.Frame().ok());
    ASSERT_TRUE(b.Frame().ok());
  }
  EXPECT_TRUE(a.Frame().ok());
  EXPECT_EQ(Process(), process);
}

TEST_F(SharedWorker, ThatIsLostIsLostToAllAndTheNextEngineHasANewOne) {
  std::promise<absl::Status> told;
  EngineOptions idle = Options();
  idle.lost = [&](const absl::Status& status) { told.set_value(status); };
  conformance::EngineDriver a = Drive(idle);
  conformance::EngineDriver b = Drive(Options());
  const pid_t process = Process();
  ASSERT_TRUE(b.SetTarget(target_).ok());
  ASSERT_EQ(kill(process, SIGKILL), 0);
  // Also to the one that had no call under way.
  EXPECT_EQ(told.get_future().get().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(b.Frame().status().code(), absl::StatusCode::kDataLoss);
  conformance::EngineDriver c = Drive(Options());
  EXPECT_NE(Process(), process);
  ASSERT_TRUE(c.SetTarget(target_).ok());
  EXPECT_TRUE(c.Frame().ok());
}

TEST_F(SharedWorker, ThatIsNotWaitedForAnswersWhenItIsThere) {
  EngineOptions options = Options();
  options.wait_until_ready = false;
  conformance::EngineDriver a = Drive(options);
  ASSERT_TRUE(a.SetTarget(target_).ok());
  ASSERT_TRUE(a.Frame().ok());
  EXPECT_EQ(a.engine().info().device, "CPU, 1 thread, in a process of its own");
}

TEST_F(SharedWorker, WhoseCallsAreInlineAnswersWithinThem) {
  EngineOptions options = Options();
  options.inline_execution = true;
  const absl::StatusOr<std::unique_ptr<Engine>> engine = CreateEngine(options);
  ASSERT_TRUE(engine.ok()) << engine.status();
  absl::Status set = absl::UnknownError("no answer yet"), drawn = set;
  (*engine)->SetTarget(target_, [&](absl::Status status) { set = std::move(status); });
  EXPECT_TRUE(set.ok()) << set;
  std::vector<std::byte> bytes(target_.layout.bytes());
  std::vector<uint64_t> numbers(target_.layout.pictures());
  (*engine)->SubmitFrame({1, 0}, {bytes, numbers},
                         [&](absl::StatusOr<FrameResult> result) { drawn = result.status(); });
  EXPECT_TRUE(drawn.ok()) << drawn;
}

TEST_F(SharedWorker, ThatIsNotWaitedForAndCannotServeSaysWhy) {
  EngineOptions options = Options();
  options.wait_until_ready = false;
  options.workers = nullptr;
  options.worker = "/bin/true";
  const absl::StatusOr<std::unique_ptr<Engine>> engine = CreateEngine(options);
  if (!engine.ok()) {  // it has already exited
    EXPECT_EQ(engine.status().code(), absl::StatusCode::kFailedPrecondition);
    return;
  }
  std::promise<absl::Status> answer;
  (*engine)->SetTarget(target_, [&](const absl::Status& status) { answer.set_value(status); });
  EXPECT_EQ(answer.get_future().get().code(), absl::StatusCode::kDataLoss);
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

TEST(DefaultWorkerProgram, IsTheNearestThatExistsAndWithCudaIfBothDo) {
  namespace fs = std::filesystem;
  const fs::path root =
      fs::path(::testing::TempDir()) / ("voxeld_worker_program_" + std::to_string(getpid()));
  const fs::path running = root / "usr/bin/voxeld";
  const fs::path installed = root / "usr/libexec/voxeld/voxeld-engine";
  EXPECT_EQ(DefaultWorkerProgram(running), installed) << "the name for messages if none exists";
  for (const fs::path& nearer :
       {installed, root / "usr/libexec/voxeld/voxeld-engine-cuda", root / "usr/voxeld-engine",
        root / "usr/voxeld-engine-cuda", root / "usr/bin/voxeld-engine",
        root / "usr/bin/voxeld-engine-cuda"}) {
    fs::create_directories(nearer.parent_path());
    std::ofstream(nearer) << "a program";
    EXPECT_EQ(DefaultWorkerProgram(running), nearer);
  }
  fs::remove(root / "usr/bin/voxeld-engine");
  EXPECT_EQ(DefaultWorkerProgram(running), root / "usr/bin/voxeld-engine-cuda");
  fs::remove_all(root);
}

}  // namespace
}  // namespace voxeld::gpu
