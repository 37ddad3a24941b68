// Tests a rank that is lost, and ranks whose results begin to differ.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "display/sync/mutex.h"
#include "gpu/ranks/ranked_engine.h"
#include "gpu/worker/worker_engine.h"
#include "tests/conformance/scene_generator.h"
#include "tests/gpu/ranks/rank_options.h"

namespace voxeld::gpu {
namespace {

using conformance::DeltaBuffer;
using conformance::EngineDriver;
using conformance::SceneGenerator;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class LostRank : public ::testing::Test {
 protected:
  LostRank()
      : file_((std::filesystem::path(::testing::TempDir()) /
               ("voxeld_lost_rank_" + std::to_string(getpid())))
                  .string()) {
    setenv("VOXELD_FAULT_FILE", file_.c_str(), 1);
  }
  ~LostRank() override { unsetenv("VOXELD_FAULT_FILE"); }

  EngineOptions Options(int ranks) {
    EngineOptions options = RankOptions(ranks);
    options.lost = [this](const absl::Status& status) {
      sync::MutexLock lock(mutex_);
      losses_.push_back(status);
      lost_.NotifyAll();
    };
    return options;
  }
  // Makes the next frame of the rank that checks first fail.
  void FailOneRank(const std::string& kind) {
    std::ofstream(file_ + ".next") << kind;
    std::filesystem::rename(file_ + ".next", file_);
  }
  // Waits for the loss that is reported after `before` others.
  absl::Status AwaitLoss(size_t before = 0) {
    sync::MutexLock lock(mutex_);
    while (losses_.size() <= before) lost_.Wait(mutex_);
    return losses_[before];
  }
  size_t losses() {
    sync::MutexLock lock(mutex_);
    return losses_.size();
  }

  const std::string file_;
  const Target target_ = SceneGenerator(7).RandomTarget();
  sync::Mutex mutex_;
  sync::CondVar lost_;
  std::vector<absl::Status> losses_ VOXELD_GUARDED_BY(mutex_);
};

TEST_F(LostRank, TakesTheOthersAlongAndIsToldOnce) {
  for (const char* kind : {"crash", "exit", "dataloss"}) {
    for (const int ranks : {2, 3}) {
      SCOPED_TRACE(std::string(kind) + ", " + std::to_string(ranks) + " ranks");
      const size_t before = losses();
      {
        EngineDriver engine = Drive(Options(ranks));
        ASSERT_TRUE(engine.SetTarget(target_).ok());
        ASSERT_TRUE(engine.Frame().ok());
        FailOneRank(kind);
        const absl::Status status = engine.Frame().status();
        EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
        EXPECT_THAT(std::string(status.message()), StartsWith("GPU "));
        EXPECT_FALSE(IsLate(status));
        EXPECT_FALSE(std::filesystem::exists(file_)) << "no rank failed";
        const absl::Status again = engine.Frame().status();
        EXPECT_EQ(again.code(), absl::StatusCode::kDataLoss);
        EXPECT_EQ(engine.SetTarget(target_).code(), absl::StatusCode::kDataLoss);
        EXPECT_EQ(engine.Apply(DeltaBuffer()).code(), absl::StatusCode::kDataLoss);
        EXPECT_EQ(AwaitLoss(before).code(), absl::StatusCode::kDataLoss);
      }
      EXPECT_EQ(losses(), before + 1);
    }
  }
}

TEST_F(LostRank, ThatHangsIsGivenUpAfterTheDeadline) {
  EngineOptions options = Options(2);
  options.worker_deadline_ns = 2'000'000'000;
  EngineDriver engine = Drive(options);
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  FailOneRank("hang");
  const absl::Status status = engine.Frame().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()),
              AllOf(StartsWith("GPU "), HasSubstr("did not answer in time")));
  EXPECT_TRUE(IsLate(status)) << "slow, perhaps, not faulty";
  EXPECT_TRUE(IsLate(AwaitLoss()));
}

TEST_F(LostRank, ThatWasNotAskedForAnythingIsToldToo) {
  EngineDriver engine = Drive(Options(2));
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  FailOneRank("crash");
  std::vector<std::byte> bytes(target_.layout.bytes());
  std::vector<uint64_t> numbers(target_.layout.pictures());
  std::promise<absl::Status> answer;
  engine.engine().SubmitFrame({1, 0}, {bytes, numbers}, [&](absl::StatusOr<FrameResult> result) {
    answer.set_value(result.status());
  });
  EXPECT_EQ(AwaitLoss().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(answer.get_future().get().code(), absl::StatusCode::kDataLoss);
}

// Only one rank is out of memory for a frame that the others have drawn.
TEST_F(LostRank, RanksThatDifferAreLost) {
  EngineDriver engine = Drive(Options(2));
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  ASSERT_TRUE(engine.Frame().ok());
  FailOneRank("exhausted");
  const absl::Status status = engine.Frame().status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(status.message(),
              AllOf(HasSubstr("do not agree any more: GPU "), HasSubstr("no room")));
  EXPECT_TRUE(IsOutOfMemory(status));
  EXPECT_EQ(engine.Frame().status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(AwaitLoss().message(), HasSubstr("do not agree"));
}

TEST_F(LostRank, WhatAllRefuseLosesNobody) {
  SceneGenerator generator(11);
  conformance::SceneModel scene = generator.RandomScene(24);
  EngineDriver one = Drive({.kind = EngineKind::kCpu, .threads = 1});
  EngineDriver engine = Drive(Options(3));
  DeltaBuffer delta;
  delta.PutWhole(scene);
  for (EngineDriver* each : {&one, &engine}) {
    ASSERT_TRUE(each->SetTarget(target_).ok());
    ASSERT_TRUE(each->Apply(delta).ok());
    ASSERT_TRUE(each->Frame().ok());
    DeltaBuffer bad;
    bad.Drop(Op::kDropDrawable, 987'654);
    EXPECT_EQ(each->Apply(bad).code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(each->Frame({.frame = 1}, {}).status().code(), absl::StatusCode::kInvalidArgument);
    ASSERT_TRUE(each->Frame().ok());
  }
  EXPECT_TRUE(engine.pictures() == one.pictures());
  EXPECT_EQ(engine.changed_in(), one.changed_in());
  EXPECT_EQ(losses(), 0u);
}

// After a loss the owner makes a new engine, with its own ranks and link.
TEST_F(LostRank, AnEngineAfterItDrawsTheSame) {
  SceneGenerator generator(13);
  const conformance::SceneModel scene = generator.RandomScene(24);
  DeltaBuffer delta;
  delta.PutWhole(scene);
  std::vector<std::byte> pictures;
  for (int life = 0; life < 3; ++life) {
    EngineDriver engine = Drive(Options(2));
    ASSERT_TRUE(engine.SetTarget(target_).ok());
    ASSERT_TRUE(engine.Apply(delta).ok());
    ASSERT_TRUE(engine.Frame().ok());
    if (life == 0) pictures = engine.pictures();
    EXPECT_TRUE(engine.pictures() == pictures);
    EXPECT_THAT(engine.engine().info().reason, HasSubstr("by NCCL"));
    FailOneRank("crash");
    EXPECT_EQ(engine.Frame().status().code(), absl::StatusCode::kDataLoss);
  }
}

}  // namespace
}  // namespace voxeld::gpu
