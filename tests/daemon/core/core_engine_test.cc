// Tests an engine in a process of its own that is lost: the CPU takes over, the engine returns, and
// the entity that makes it fault is found.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "gpu/worker/worker_pool.h"
#include "tests/daemon/fakes/faulty_gpu.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::DeleteId;
using testing::Dots;
using ::testing::ElementsAre;
using testing::Entity1;
using testing::FaultyGpu;
using testing::GpuScript;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::Put;
using testing::Simulation;
using Kind = CommitOutcome::Kind;
using What = EngineEvent::What;

constexpr uint32_t kBad = 0xBADBAD, kBadToo = 0x0BAD00;

class CoreEngine : public ::testing::Test {
 protected:
  CoreEngine() { Begin(); }

  void Begin(int displays = 1) {
    gpu::EngineOptions options;
    options.kind = gpu::EngineKind::kCuda;
    options.workers = std::make_shared<gpu::WorkerPool>();
    sim_ = std::make_unique<Simulation>(
        Limits(), displays,
        [this](const gpu::EngineOptions& wanted) {
          auto engine = std::make_unique<FaultyGpu>(wanted, script_);
          newest_ = engine.get();
          return engine;
        },
        options);
    sim_->Start();
    client_ = sim_->Open();
  }

  DisplayFigures Figures(size_t display = 0) { return sim_->GetStats().displays[display]; }

  // Commits an entity, and lets the display show the result.
  void Draw(const std::string& id, float x, uint32_t color = 0xFFFFFF) {
    sim_->Send(client_, ++frame_id_, Put("a", id, Entity1(Dots(x, color))));
    ShowAll();
  }
  void ShowAll() {
    while (sim_->Show()) {
    }
  }
  // Returns the outcome of the newest commit.
  Kind Outcome() {
    const std::vector<CommitOutcome> outcomes = client_.sink->OutcomesOf(frame_id_);
    EXPECT_EQ(outcomes.size(), 1u);
    return outcomes.empty() ? Kind::kLost : outcomes[0].kind;
  }
  // Advances the time until nothing more is due soon.
  void Advance(sync::TimeNs time) {
    for (sync::TimeNs step = 0; step < time; step += sync::kSecond / 20) {
      sim_->Advance(sync::kSecond / 20);
      ShowAll();
    }
  }
  std::vector<What> Events() const {
    std::vector<What> all;
    for (const EngineEvent& event : sim_->engine_events) all.push_back(event.what);
    return all;
  }

  const std::shared_ptr<GpuScript> script_ = std::make_shared<GpuScript>();
  FaultyGpu* newest_ = nullptr;  // the newest one
  std::unique_ptr<Simulation> sim_;
  Simulation::Client client_;
  uint64_t frame_id_ = 0;
};

TEST_F(CoreEngine, ThatIsLostCostsNoVolumeAndComesBackAfterDrawingTheSameBytes) {
  Draw("one", -0.5f);
  EXPECT_EQ(Figures().engine, "cuda");
  EXPECT_EQ(Figures().engine_degraded, "");
  script_->faults = 1;
  Draw("two", 0.5f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cpu");
  EXPECT_THAT(figures.engine_degraded, HasSubstr("cudaErrorIllegalAddress"));
  EXPECT_EQ(figures.engine_faults, 1u);
  EXPECT_EQ(figures.commits_lost, 0u);
  EXPECT_FALSE(figures.volume_held);
  EXPECT_THAT(Events(), ElementsAre(What::kLost, What::kTookOver));

  Advance(sync::kSecond);
  figures = Figures();
  EXPECT_EQ(figures.engine, "cuda");
  EXPECT_EQ(figures.engine_degraded, "");
  EXPECT_EQ(figures.engine_returns, 1u);
  EXPECT_GE(figures.return_last_ns, sync::kSecond / 4);
  EXPECT_EQ(figures.return_last_ns, figures.return_max_ns);
  // First in a process of its own, then in the one that all share.
  EXPECT_THAT(script_->shared, ElementsAre(true, false, true));
  EXPECT_THAT(Events(), ElementsAre(What::kLost, What::kTookOver, What::kReturned));
  Draw("three", -0.25f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  EXPECT_EQ(Figures().engine, "cuda");
  EXPECT_EQ(script_->cpu_engines, 1);
}

TEST_F(CoreEngine, ThatComesBackSendsEveryPictureOnce) {
  Draw("one", -0.5f);
  script_->faults = 1;
  Draw("two", 0.5f);
  Advance(sync::kSecond);
  ASSERT_EQ(Figures().engine, "cuda");
  for (const bool first : {true, false}) {
    sim_->Send(client_, ++frame_id_, Put("a", "three", first ? 0.1f : -0.9f));
    const display::SliceFramePtr frame = sim_->display().in_flight();
    ASSERT_NE(frame, nullptr);
    size_t fresh = 0;
    for (const uint64_t number : frame->changed_in) fresh += number == frame->volume;
    if (first) {
      EXPECT_EQ(fresh, frame->changed_in.size());
    } else {
      EXPECT_LT(fresh, frame->changed_in.size());
    }
    ShowAll();
  }
}

TEST_F(CoreEngine, ThatIsLostBetweenCommitsIsReplacedAtOnce) {
  Draw("one", -0.5f);
  newest_->Die();
  sim_->core->Step();
  EXPECT_EQ(Figures().engine, "cpu");
  Advance(sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
}

TEST_F(CoreEngine, AnEntityThatFaultsIsFoundPinnedAndLetGoWithItsEnd) {
  for (int i = 0; i < 13; ++i) {
    Draw(std::to_string(i), static_cast<float>(i) / 8 - 0.75f, i == 6 ? kBad : 0x00FF00 + i);
  }
  script_->bad_colors = {kBad};
  Draw("more", 0.9f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  EXPECT_EQ(Figures().engine, "cpu");
  Advance(sync::kSecond);
  DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cuda");
  ASSERT_EQ(figures.pinned_entities.size(), 1u);
  EXPECT_THAT(figures.pinned_entities[0], HasSubstr("entity \"6\" of layer \"a\""));
  EXPECT_THAT(figures.engine_degraded, HasSubstr("drawn by the CPU"));
  EXPECT_GE(figures.engine_faults, 2u);
  EXPECT_EQ(figures.engine_returns, 1u);
  // It may be changed, also into one that faults.
  Draw("6", 0.3f, kBad);
  EXPECT_EQ(Figures().engine, "cuda");
  EXPECT_EQ(Outcome(), Kind::kPresented);
  sim_->Send(client_, ++frame_id_, DeleteId("a", "6"));
  ShowAll();
  figures = Figures();
  EXPECT_THAT(figures.pinned_entities, IsEmpty());
  EXPECT_EQ(figures.engine_degraded, "");
  EXPECT_EQ(figures.commits_lost, 0u);
}

TEST_F(CoreEngine, SeveralEntitiesThatFaultAreAllFound) {
  for (int i = 0; i < 9; ++i) {
    Draw(std::to_string(i), static_cast<float>(i) / 8 - 0.75f,
         i == 0   ? kBad
         : i == 8 ? kBadToo
                  : 0x00FF00 + i);
  }
  script_->bad_colors = {kBad, kBadToo};
  Draw("more", 0.9f);
  Advance(2 * sync::kSecond);
  const DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cuda");
  ASSERT_EQ(figures.pinned_entities.size(), 2u);
  EXPECT_THAT(figures.pinned_entities[0], HasSubstr("\"8\""));
  EXPECT_THAT(figures.pinned_entities[1], HasSubstr("\"0\""));
}

TEST_F(CoreEngine, OfABrokenGpuStaysAwayAndNoEntityIsBlamed) {
  Draw("one", -0.5f);
  script_->broken = true;
  Draw("two", 0.5f);
  Advance(10 * sync::kSecond);
  DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cpu");
  EXPECT_THAT(figures.engine_degraded, HasSubstr("even when it draws nothing"));
  EXPECT_THAT(figures.pinned_entities, IsEmpty());
  EXPECT_EQ(script_->shared.size(), 3u);  // at the start, whole, nothing
  Draw("three", 0.1f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  script_->broken = false;
  Advance(61 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
}

TEST_F(CoreEngine, ThatFaultedTwiceByAccidentIsNoEntitysFault) {
  for (int i = 0; i < 5; ++i) Draw(std::to_string(i), static_cast<float>(i) / 8 - 0.75f);
  script_->faults = 2;
  Draw("more", 0.9f);
  Advance(3 * sync::kSecond);
  const DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cuda");
  EXPECT_EQ(figures.engine_faults, 2u);
  EXPECT_THAT(figures.pinned_entities, IsEmpty());
  EXPECT_THAT(Events(), ElementsAre(What::kLost, What::kTookOver, What::kFaulted, What::kAway,
                                    What::kReturned));
}

TEST_F(CoreEngine, ThatIsLateIsNoFaultOfTheScene) {
  Draw("one", -0.5f);
  script_->late = 2;
  Draw("two", 0.5f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  Advance(3 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
  EXPECT_THAT(Figures().pinned_entities, IsEmpty());
  // At the start; late; whole and shared.
  EXPECT_THAT(script_->shared, ElementsAre(true, false, false, true));
}

// For one of several GPUs: nothing in the scene is to blame, and no search is made.
TEST_F(CoreEngine, RanksOfUnequalMemoryAreNoFaultOfTheScene) {
  Draw("one", -0.5f);
  script_->unequal = 2;
  Draw("two", 0.5f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  Advance(4 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
  EXPECT_THAT(Figures().pinned_entities, IsEmpty());
  // At the start; unequal; whole and shared: no part of the scene was tried.
  EXPECT_THAT(script_->shared, ElementsAre(true, false, false, true));
}

TEST_F(CoreEngine, WithoutMemoryForTheSceneGivesWayToTheCpu) {
  Draw("one", -0.5f);
  script_->full = true;
  Draw("two", 0.5f);
  EXPECT_EQ(Outcome(), Kind::kPresented);
  DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cpu");
  EXPECT_EQ(figures.engine_out_of_memory, 1u);
  EXPECT_EQ(figures.engine_faults, 0u);
  EXPECT_EQ(figures.commits_lost, 0u);
  EXPECT_THAT(figures.engine_degraded, HasSubstr("out of memory"));
  Advance(2 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cpu");
  script_->full = false;
  Advance(4 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
  EXPECT_EQ(Figures().engine_degraded, "");
}

TEST(CoreHealth, AnEngineThatRefusesHoldsTheLastVolumeAndSaysWhy) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.engine().fail_staging = true;
  sim.Send(client, 1, Put("a", "x"));
  DisplayFigures figures = sim.GetStats().displays[0];
  EXPECT_TRUE(figures.volume_held);
  EXPECT_THAT(figures.engine_degraded, HasSubstr("no staging memory"));
  sim.Advance(sync::kSecond);
  figures = sim.GetStats().displays[0];
  EXPECT_FALSE(figures.volume_held);
  EXPECT_EQ(figures.engine_degraded, "");
}

TEST_F(CoreEngine, ThatDrawsOtherBytesIsNotTaken) {
  Draw("one", -0.5f);
  script_->faults = 1;
  script_->wrong = true;
  Draw("two", 0.5f);
  Advance(2 * sync::kSecond);
  DisplayFigures figures = Figures();
  EXPECT_EQ(figures.engine, "cpu");
  EXPECT_GE(figures.engine_mismatches, 1u);
  EXPECT_THAT(figures.engine_degraded, HasSubstr("other bytes"));
  script_->wrong = false;
  Advance(4 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
}

TEST_F(CoreEngine, ThatCannotBeHadIsAskedForMoreAndMoreSeldom) {
  Draw("one", -0.5f);
  script_->faults = 1;
  script_->absent = absl::FailedPreconditionError("no CUDA device can be used");
  Draw("two", 0.5f);
  Advance(16 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cpu");
  EXPECT_THAT(Figures().engine_degraded, HasSubstr("no CUDA device can be used"));
  EXPECT_EQ(Figures().engine_faults, 1u);  // an engine that is absent is not a fault of the scene
  EXPECT_EQ(script_->shared.size(), 1u + 6u);  // 0.25, 0.75, 1.75, 3.75, 7.75, 15.75 s
  script_->absent = absl::OkStatus();
  Advance(17 * sync::kSecond);
  EXPECT_EQ(Figures().engine, "cuda");
}

TEST_F(CoreEngine, ThatFaultsAgainAndAgainComesBackMoreAndMoreSeldom) {
  Draw("one", -0.5f);
  std::vector<int64_t> away;
  for (int i = 0; i < 4; ++i) {
    script_->faults = 1;
    Draw("two", static_cast<float>(i) / 10);
    Advance(4 * sync::kSecond);
    ASSERT_EQ(Figures().engine, "cuda");
    away.push_back(Figures().return_last_ns);
  }
  for (size_t i = 1; i < away.size(); ++i) EXPECT_GT(away[i], away[i - 1]);
  for (int i = 0; i < 60; ++i) Draw("three", static_cast<float>(i) / 100);
  script_->faults = 1;
  Draw("two", 0.7f);
  Advance(4 * sync::kSecond);
  EXPECT_EQ(Figures().return_last_ns, away[0]);
}

TEST_F(CoreEngine, WhileTheCpuHasNotDrawnTheLastVolumeIsHeldAndCommitsWait) {
  Draw("one", -0.5f);
  script_->faults = 1;
  script_->slow_cpu = true;
  Draw("two", 0.5f);
  sim_->Send(client_, ++frame_id_, Put("a", "three", 0.1f));
  EXPECT_FALSE(Figures().volume_held);
  Advance(sync::kSecond / 2);
  DisplayFigures figures = Figures();
  EXPECT_TRUE(figures.volume_held);
  EXPECT_EQ(figures.commits_pending, 2u);
  EXPECT_EQ(figures.commits_lost, 0u);
  EXPECT_THAT(Events(), ElementsAre(What::kLost, What::kHolding));
  while (!script_->cpu_frames.empty()) {
    script_->RunCpu();
    sim_->core->Step();
    ShowAll();
  }
  figures = Figures();
  EXPECT_FALSE(figures.volume_held);
  EXPECT_GE(figures.takeover_last_ns, sync::kSecond / 2);
  EXPECT_EQ(figures.commits_pending, 0u);
  EXPECT_EQ(figures.commits_lost, 0u);
  EXPECT_EQ(Outcome(), Kind::kPresented);
}

TEST_F(CoreEngine, OfADisplayThatDoesNotShowHoldsNothing) {
  Draw("one", -0.5f);
  script_->faults = 1;
  script_->slow_cpu = true;
  Draw("two", 0.5f);
  Advance(sync::kSecond / 2);
  EXPECT_TRUE(Figures().volume_held);
  DisplayUpdate blank;
  blank.blank = true;
  ASSERT_TRUE(sim_->Update(blank).ok());
  EXPECT_FALSE(Figures().volume_held);
  EXPECT_THAT(Events(), ElementsAre(What::kLost, What::kHolding, What::kNotHeld));
}

TEST_F(CoreEngine, OfOneDisplayDoesNotTouchTheOthers) {
  Begin(2);
  Draw("one", -0.5f);
  while (sim_->Show(1)) {
  }
  script_->faults = 1;
  sim_->Send(client_, ++frame_id_, Put("a", "two", 0.5f));
  EXPECT_EQ(Figures(0).engine_faults + Figures(1).engine_faults, 1u);
  EXPECT_EQ(Figures(0).commits_lost + Figures(1).commits_lost, 0u);
  EXPECT_NE(Figures(0).engine, Figures(1).engine);
}

TEST_F(CoreEngine, AskedForOnTheCpuInThisProcessHasNobodyWhoCaresForIt) {
  sim_ = std::make_unique<Simulation>(Limits(), 1, [this](const gpu::EngineOptions& wanted) {
    return std::make_unique<FaultyGpu>(wanted, script_);
  });
  sim_->Start();
  EXPECT_EQ(Figures().engine, "cpu");
  EXPECT_EQ(Figures().engine_degraded, "");
}

}  // namespace
}  // namespace voxeld::daemon
