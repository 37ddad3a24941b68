// Tests displays: settings, patterns, captures, removal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/pipeline/link_watch.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;
using testing::Put;
using testing::Simulation;
using Kind = CommitOutcome::Kind;
using NotShown = CommitOutcome::NotShown;

struct Captured {
  absl::StatusOr<display::DecodedVolume> result = absl::UnknownError("no answer");
  bool done() const { return !absl::IsUnknown(result.status()); }
};

std::shared_ptr<Captured> Capture(Simulation& sim, sync::TimeNs timeout, uint64_t at_least) {
  auto captured = std::make_shared<Captured>();
  sim.core->Capture("", timeout, at_least, [captured](auto r) { captured->result = std::move(r); });
  sim.core->Step();
  return captured;
}

TEST(CoreDisplays, NamesAreUniqueAndDisplaysComeBeforeStart) {
  Simulation sim;
  const auto add = [&](std::string name, const ViewOptions& view = {}) {
    return sim.core->AddDisplay(std::make_unique<testing::ScriptedDisplay>(
                                    testing::SmallDisplay(std::move(name)), sim.clock),
                                {}, {.view = view});
  };
  EXPECT_EQ(add("main").code(), absl::StatusCode::kAlreadyExists);
  // A scripted display cannot hold a volume: it shows what it gets.
  const absl::Status unlocked = sim.core->AddDisplay(
      std::make_unique<testing::ScriptedDisplay>(testing::SmallDisplay("locked"), sim.clock), {},
      {.genlock = "wall"});
  EXPECT_EQ(unlocked.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(unlocked.message(), HasSubstr("driver scripted cannot hold a volume"));
  ViewOptions bad;
  bad.transform.m[0] = 0;
  EXPECT_EQ(add("second", bad).code(), absl::StatusCode::kInvalidArgument);
  sim.make_engine_fails = absl::FailedPreconditionError("no CUDA driver");
  const absl::Status no_engine = add("second");
  EXPECT_EQ(no_engine.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(no_engine.message(), HasSubstr("\"second\": no CUDA driver"));
  sim.Start();
  EXPECT_EQ(add("third").code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(sim.core->Start().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(CoreDisplays, AnUpdateIsWholeOrNothing) {
  Simulation sim;
  sim.Start();
  DisplayUpdate update;
  update.brightness = 0.5;
  update.view = ViewOptions{ViewOptions::Mode::kVoxels, {}, {}};
  update.pattern = TestPattern::kGrid;
  absl::StatusOr<DisplayDescription> result = sim.Update(update);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->brightness, 0.5);
  EXPECT_EQ(result->scene_to_voxel, gpu::Affine());
  EXPECT_EQ(result->pattern, TestPattern::kGrid);

  update.brightness = 1.5;
  update.blank = true;
  EXPECT_THAT(sim.Update(update).status().message(), HasSubstr("brightness is 1.5"));
  update.brightness = 0.25;
  update.view->transform.m[0] = 0;
  EXPECT_EQ(sim.Update(update).status().code(), absl::StatusCode::kInvalidArgument);
  update.view.reset();
  sim.display().refuse_blank = absl::UnavailableError("the device does not answer");
  EXPECT_EQ(sim.Update(update).status().code(), absl::StatusCode::kUnavailable);
  sim.core->GetDisplay("main", [&](auto r) { result = std::move(r); });
  sim.core->Step();
  EXPECT_EQ(result->brightness, 0.5);
  EXPECT_EQ(result->pattern, TestPattern::kGrid);
  EXPECT_EQ(result->info.name, "main");
  EXPECT_EQ(result->state, display::DisplayState::kShowing);
  EXPECT_FALSE(result->blank);
}

TEST(CoreDisplays, AViewThatTheSceneDoesNotFitIsRefused) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));
  DisplayUpdate update;
  update.view = ViewOptions{ViewOptions::Mode::kVoxels, {}, {}};
  for (int axis = 0; axis < 3; ++axis) update.view->transform.m[axis * 5] = 1e12;
  const absl::Status refused = sim.Update(update).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(refused.message(), HasSubstr("entity \"x\" of layer \"a\""));
  EXPECT_EQ(sim.engine().targets.size(), 1u);
  // Nor does a refused view stay behind as something that must fit.
  sim.Send(client, 2, Put("a", "x", 2));
  EXPECT_TRUE(client.sink->issues.empty());
  // Once it is accepted, it applies.
  sim.Send(client, 3, testing::DeleteAllMine());
  ASSERT_TRUE(sim.Update(update).ok());
  sim.Send(client, 4, Put("a", "x", 1));
  ASSERT_EQ(client.sink->issues.size(), 1u);
  EXPECT_EQ(client.sink->issues[0].reason, Reason::kOutOfRange);
}

TEST(CoreDisplays, ACaptureWaitsForThePatternThatWasSetBeforeIt) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));
  while (sim.Show()) {
  }
  DisplayUpdate update;
  update.pattern = TestPattern::kWhite;
  ASSERT_TRUE(sim.Update(update).ok());
  const auto captured = Capture(sim, sync::kSecond, 0);
  EXPECT_TRUE(sim.Show());  // the pattern, which was on its way when the capture was requested
  EXPECT_FALSE(captured->done());
  EXPECT_TRUE(sim.Show());  // sent again, whole
  ASSERT_TRUE(captured->done());
  EXPECT_TRUE(captured->result.ok()) << captured->result.status();
}

TEST(CoreDisplays, UnknownNamesListThoseThereAre) {
  Simulation sim({}, 2);
  sim.Start();
  EXPECT_THAT(sim.Update({}, "nobody").status().message(),
              HasSubstr("no display \"nobody\"; there are: \"main\", \"display1\""));
  std::vector<DisplayDescription> all;
  sim.core->ListDisplays([&](auto r) { all = *r; });
  sim.core->Step();
  ASSERT_EQ(all.size(), 2u);
  EXPECT_EQ(all[1].info.name, "display1");
}

TEST(CoreDisplays, ANewViewIsDrawnAnew) {
  Simulation sim;
  sim.Start();
  ASSERT_EQ(sim.engine().targets.size(), 1u);
  EXPECT_EQ(sim.engine().targets[0].view.m[0], 4);  // 8 mm across, ±1
  DisplayUpdate update;
  update.view = ViewOptions{ViewOptions::Mode::kVoxels, {}, {}};
  ASSERT_TRUE(sim.Update(update).ok());
  ASSERT_EQ(sim.engine().targets.size(), 2u);
  EXPECT_EQ(sim.engine().targets[1].view, gpu::Affine());
  EXPECT_EQ(sim.engine().frames.size(), 2u);
  ASSERT_TRUE(sim.Update(update).ok());  // the same again: no effect
  EXPECT_EQ(sim.engine().frames.size(), 2u);
}

TEST(CoreDisplays, APatternTakesTheScenesPlaceForAWhile) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Send(client, 2, Put("a", "x", 2));
  sim.Send(client, 3, Put("a", "x", 3));  // waits
  DisplayUpdate update;
  update.pattern = TestPattern::kWhite;
  ASSERT_TRUE(sim.Update(update).ok());
  ASSERT_EQ(client.sink->OutcomesOf(3).size(), 1u);
  EXPECT_EQ(client.sink->OutcomesOf(3)[0].why, NotShown::kHidden);
  sim.Send(client, 4, Put("a", "x", 4));
  EXPECT_EQ(client.sink->OutcomesOf(4)[0].why, NotShown::kHidden);
  while (sim.Show()) {
  }
  EXPECT_EQ(client.sink->OutcomesOf(2)[0].kind, Kind::kPresented);
  ASSERT_EQ(sim.engine().scene->geometries().size(), 1u);
  EXPECT_EQ(sim.engine().scene->geometries().begin()->second.record.kind, gpu::PrimitiveKind::kBox);
  EXPECT_EQ(sim.engine().targets.back().view, gpu::Affine());

  for (const TestPattern pattern :
       {TestPattern::kAxes, TestPattern::kCorners, TestPattern::kGrid, TestPattern::kRamp,
        TestPattern::kWhite, TestPattern::kBars, TestPattern::kDensity, TestPattern::kSlices,
        TestPattern::kNone}) {
    update.pattern = pattern;
    ASSERT_TRUE(sim.Update(update).ok());
    EXPECT_TRUE(sim.Show());
  }
  EXPECT_EQ(sim.engine().engines, 1);  // no delta was refused
  ASSERT_EQ(sim.engine().scene->geometries().size(), 1u);
  EXPECT_EQ(sim.engine().scene->geometries().begin()->second.positions[0], 4);
  EXPECT_EQ(sim.engine().targets.back().view.m[0], 4);
  EXPECT_EQ(sim.GetStats().displays[0].volumes_lost, 0u);
}

TEST(CoreDisplays, ACaptureWaitsForTheSnapshotThatItAsksFor) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  const auto captured = Capture(sim, sync::kSecond, 3);
  sim.Send(client, 1, Put("a", "x", 1));
  EXPECT_TRUE(sim.Show());
  EXPECT_FALSE(sim.Show());  // snapshot 2: nothing is sent again for the capture yet
  sim.Send(client, 2, Put("a", "x", 2));
  EXPECT_TRUE(sim.Show());
  EXPECT_FALSE(captured->done());
  EXPECT_TRUE(sim.Show());  // sent again, whole
  ASSERT_TRUE(captured->done());
  ASSERT_TRUE(captured->result.ok()) << captured->result.status();
  EXPECT_EQ(captured->result->volume, 3u);
  // A snapshot that looks the same is shown by the previous volume.
  sim.Send(client, 3, Put("a", "x", 2));
  const auto same = Capture(sim, sync::kSecond, 4);
  EXPECT_TRUE(sim.Show());
  ASSERT_TRUE(same->result.ok()) << same->result.status();
  EXPECT_EQ(same->result->volume, 3u);
}

TEST(CoreDisplays, ACaptureEndsInTimeAndWithTheDisplay) {
  Simulation sim;
  sim.Start();
  const auto late = Capture(sim, sync::kSecond, 9);
  EXPECT_EQ(sim.core->Step(), sim.clock.Now() + sync::kSecond);
  const auto lost = Capture(sim, 5 * sync::kSecond, 9);
  const auto stuck = Capture(sim, sync::kSecond, 0);
  sim.Advance(sync::kSecond);
  EXPECT_EQ(late->result.status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_THAT(late->result.status().message(), HasSubstr("snapshot 9"));
  EXPECT_EQ(stuck->result.status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_FALSE(lost->done());
  sim.display().Lose("cable pulled");
  sim.core->Step();
  EXPECT_EQ(lost->result.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(lost->result.status().message(), HasSubstr("cable pulled"));
  EXPECT_EQ(Capture(sim, sync::kSecond, 0)->result.status().code(), absl::StatusCode::kUnavailable);
}

TEST(CoreDisplays, WhatWentWrongWithADeviceIsToldAfterwardsToo) {
  Simulation sim({}, 2);
  sim.Start();
  sim.core->Step();
  EXPECT_EQ(sim.GetStats().displays[1].device_trouble, "");
  sim.display(1).FailTransfers(3);
  sim.core->Step();
  sim.core->Step();  // the posted work
  const std::string name = sim.GetStats().displays[1].name;
  EXPECT_THAT(sim.transfers_failed, ElementsAre(Pair(name, ElementsAre(3u))));
  EXPECT_THAT(sim.GetStats().displays[1].device_trouble, HasSubstr("transfers failed 0 s ago"));
  EXPECT_EQ(sim.GetStats().displays[0].device_trouble, "");

  sim.Advance(LinkWatch::kTold);
  EXPECT_EQ(sim.GetStats().displays[1].device_trouble, "");
  sim.display(1).Lose("cable pulled");
  sim.core->Step();
  EXPECT_EQ(sim.GetStats().displays[1].device_trouble, "") << "it is lost, and that is its state";
  sim.display(1).Attach();
  sim.core->Step();
  EXPECT_THAT(sim.GetStats().displays[1].device_trouble,
              HasSubstr("the device was lost (cable pulled) and came back 0 s ago"));
}

TEST(CoreDisplays, ACancelledCaptureHoldsNothingUp) {
  Simulation sim;
  sim.Start();
  const sync::TimeNs idle = sim.core->Step();
  // A capture that waits for its snapshot, and one that waits for the device.
  for (const uint64_t at_least : {uint64_t{9}, uint64_t{0}}) {
    absl::Status status = absl::UnknownError("no answer");
    const CaptureId id = sim.core->Capture("main", 60 * sync::kSecond, at_least,
                                           [&](auto r) { status = r.status(); });
    sim.core->CancelCapture("main", id + 1);
    sim.core->Step();
    EXPECT_TRUE(absl::IsUnknown(status));
    sim.core->CancelCapture("main", id);
    sim.core->CancelCapture("nobody", id);
    EXPECT_EQ(sim.core->Step(), idle);
    EXPECT_TRUE(absl::IsCancelled(status)) << status;
  }
}

TEST(CoreDisplays, NothingIsOwedAfterStop) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  for (uint64_t frame = 1; frame <= 4; ++frame) {
    sim.Send(client, frame, Put("a", "x", static_cast<float>(frame)));
  }
  const auto captured = Capture(sim, sync::kNever, 99);
  EXPECT_TRUE(sim.core->Stop(sync::kSecond).ok());
  for (uint64_t frame = 1; frame <= 4; ++frame) {
    ASSERT_EQ(client.sink->OutcomesOf(frame).size(), 1u);
    EXPECT_NE(client.sink->OutcomesOf(frame)[0].kind, Kind::kPresented);
  }
  EXPECT_EQ(captured->result.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Capture(sim, sync::kSecond, 0)->result.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_TRUE(sim.core->Stop(sync::kSecond).ok());
}

}  // namespace
}  // namespace voxeld::daemon
