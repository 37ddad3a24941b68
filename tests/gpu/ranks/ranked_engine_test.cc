// Tests one display drawn by several engines, each in a process of its own: for its owner they are
// one engine.
#include "gpu/ranks/ranked_engine.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/conformance/scene_generator.h"
#include "tests/gpu/ranks/rank_options.h"

namespace voxeld::gpu {
namespace {

using conformance::DeltaBuffer;
using conformance::EngineDriver;
using conformance::SceneGenerator;
using conformance::SceneModel;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kSize = 24;

TEST(SlicePart, IsCutIntoRunsThatJoinToTheWhole) {
  for (const int32_t slices : {1, 2, 7, 24, 2048}) {
    for (const int ranks : {1, 2, 3, 5, 8}) {
      int32_t end = 0;
      for (int rank = 0; rank < ranks; ++rank) {
        const SliceRange run = SlicePart{.rank = rank, .ranks = ranks}.Within(slices);
        EXPECT_EQ(run.begin, end);
        EXPECT_GE(run.end - run.begin, slices / ranks);
        EXPECT_LE(run.end - run.begin, slices / ranks + 1);
        end = run.end;
      }
      EXPECT_EQ(end, slices);
    }
  }
  const SliceRange run = SlicePart{.begin = 10, .end = 20, .rank = 1, .ranks = 2}.Within(100);
  EXPECT_EQ(run.begin, 15);
  EXPECT_EQ(run.end, 20);
}

// Changing scenes, in displays of every kind: bytes, numbers of changes, voxels and counts.
TEST(RankedEngine, EqualsOneEngineWithAnyNumberOfRanks) {
  uint64_t lit = 0;
  for (const int ranks : {1, 2, 5}) {
    for (uint64_t seed = 0; seed < 8; ++seed) {
      SCOPED_TRACE(std::to_string(ranks) + " ranks, seed " + std::to_string(seed));
      SceneGenerator generator(seed);
      SceneModel scene = generator.RandomScene(kSize);
      EngineDriver one = Drive({.kind = EngineKind::kCpu, .threads = 1});
      EngineDriver many = Drive(RankOptions(ranks));
      DeltaBuffer delta;
      delta.PutWhole(scene);
      for (int target = 0; target < 3; ++target) {
        const Target next = generator.RandomTarget();
        ASSERT_TRUE(one.SetTarget(next).ok());
        ASSERT_TRUE(many.SetTarget(next).ok());
        for (int step = 0; step < 4; ++step) {
          ASSERT_TRUE(one.Apply(delta).ok());
          ASSERT_TRUE(many.Apply(delta).ok());
          delta = DeltaBuffer();
          generator.Change(scene, kSize, delta);
          const auto want = one.Frame(), got = many.Frame();
          ASSERT_TRUE(want.ok() && got.ok()) << got.status();
          ASSERT_TRUE(many.pictures() == one.pictures());
          ASSERT_EQ(many.changed_in(), one.changed_in());
          ASSERT_TRUE(many.Voxels() == one.Voxels());
          EXPECT_EQ(got->frame, want->frame);
          EXPECT_EQ(got->changed, want->changed);
          EXPECT_EQ(got->lit_voxels, want->lit_voxels);
          EXPECT_EQ(got->pictures_drawn, want->pictures_drawn);
          EXPECT_EQ(got->singular_drawables, want->singular_drawables);
          EXPECT_GE(got->tiles_drawn, want->tiles_drawn);
          lit += got->lit_voxels;
        }
      }
    }
  }
  EXPECT_GT(lit, 10'000u);
}

TEST(RankedEngine, SaysWhatItIsMadeOfAndHowItIsLinked) {
  const EngineDriver engine = Drive(RankOptions(2));
  const EngineInfo& info = const_cast<EngineDriver&>(engine).engine().info();
  EXPECT_EQ(info.kind, EngineKind::kCuda);
  EXPECT_EQ(info.device, "GPU 0: a GPU that faults; GPU 1: a GPU that faults");
  EXPECT_EQ(info.reason, "asked for; deltas go to GPU 0 and from there to the others by NCCL");
}

TEST(RankedEngine, ThatCannotBeLinkedSendsToEachAndSaysWhy) {
  const Target target = SceneGenerator(3).RandomTarget();
  setenv("VOXELD_FAULT_LINK", "invite", 1);
  EngineOptions options = RankOptions(2);
  options.nccl = "/some/libnccl.so";
  EngineDriver engine = Drive(options);
  unsetenv("VOXELD_FAULT_LINK");
  EXPECT_EQ(engine.engine().info().reason,
            "asked for; deltas go to each GPU by itself: no library \"/some/libnccl.so\", as was "
            "asked for");
  ASSERT_TRUE(engine.SetTarget(target).ok());
  EXPECT_TRUE(engine.Frame().ok());
  options.nccl = "off";
  EXPECT_EQ(Drive(options).engine().info().reason,
            "asked for; deltas go to each GPU by itself: NCCL is off");
}

TEST(RankedEngine, IsNotToBeHadIfOneRankIsNot) {
  setenv("VOXELD_FAULT_LINK", "join", 1);
  bool told = false;
  EngineOptions options = RankOptions(3);
  options.lost = [&](const absl::Status&) { told = true; };
  const absl::Status status = CreateEngine(options).status();
  unsetenv("VOXELD_FAULT_LINK");
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(status.message(), HasSubstr("GPU 1: it does not come"));
  EXPECT_FALSE(told) << "an engine that never existed is not lost";
  options = RankOptions(2);
  options.worker = "/nowhere/engine";
  EXPECT_THAT(CreateEngine(options).status().message(),
              HasSubstr("GPU 0: /nowhere/engine cannot be started"));
}

TEST(RankedEngine, NeedsAGpuForEachRank) {
  EngineOptions options = RankOptions(3);
  options.devices[2] = 1;
  const absl::Status status = CreateEngine(options).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(status.message(), HasSubstr("GPU 1 is there twice"));
  options = RankOptions(2);
  options.nccl = std::string(5000, 'a');
  EXPECT_THAT(CreateEngine(options).status().message(), HasSubstr("has 5000 bytes"));
}

TEST(RankedEngine, WithOneGpuIsAnOrdinaryEngineOfThat) {
  EXPECT_EQ(Drive(RankOptions(1)).engine().info().device, "a GPU that faults");
}

TEST(RankedEngine, WhereTheCpuDrawsInThisProcessHasNoRanks) {
  EngineOptions options = RankOptions(2);
  options.kind = EngineKind::kCpu;
  EXPECT_THAT(Drive(options).engine().info().device,
              AllOf(HasSubstr("CPU, 1 thread"), Not(HasSubstr("rank"))));
}

// As the pipeline makes an engine that is to return: calls wait until it is ready.
TEST(RankedEngine, ThatIsNotWaitedForAnswersWhenItIsThere) {
  const Target target = SceneGenerator(5).RandomTarget();
  EngineOptions options = RankOptions(2);
  options.wait_until_ready = false;
  EngineDriver engine = Drive(options);
  ASSERT_TRUE(engine.SetTarget(target).ok());
  EXPECT_THAT(engine.engine().info().reason, HasSubstr("by NCCL"));
  EXPECT_TRUE(engine.Frame().ok());
}

TEST(RankedEngine, ThatGoesBeforeItWasThereAnswersEveryCall) {
  for (int i = 0; i < 20; ++i) {
    std::vector<absl::Status> answers;
    EngineOptions options = RankOptions(2);
    options.wait_until_ready = false;
    {
      auto engine = CreateEngine(options);
      ASSERT_TRUE(engine.ok()) << engine.status();
      for (int call = 0; call < 5; ++call) {
        auto block = (*engine)->AcquireStaging(16);
        ASSERT_TRUE(block.ok());
        (*engine)->Apply(*std::move(block), 0,
                         [&](absl::Status status) { answers.push_back(std::move(status)); });
      }
    }
    ASSERT_EQ(answers.size(), 5u);
    for (const absl::Status& status : answers) {
      EXPECT_TRUE(status.ok() || absl::IsCancelled(status)) << status;
    }
  }
}

}  // namespace
}  // namespace voxeld::gpu
