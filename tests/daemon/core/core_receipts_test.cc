// Tests receipts in single cases: the messages to a client about each commit, rule by rule.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::Put;
using testing::RecordingSink;
using testing::SetLayer;
using testing::Simulation;
using Kind = CommitOutcome::Kind;
using NotShown = CommitOutcome::NotShown;

CommitOutcome Only(const RecordingSink& sink, uint64_t frame_id) {
  const std::vector<CommitOutcome> outcomes = sink.OutcomesOf(frame_id);
  EXPECT_EQ(outcomes.size(), 1u) << "frame " << frame_id;
  return outcomes.empty() ? CommitOutcome() : outcomes.front();
}

TEST(CoreReceipts, ACommitIsAcceptedThenPresented) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  EXPECT_THAT(client.info.displays, ElementsAre("main"));
  sim.Send(client, 7, Put("a", "x"));
  const auto accepted = client.sink->Of<Accepted>();
  ASSERT_EQ(accepted.size(), 1u);
  EXPECT_EQ(accepted[0].first.frame_id, 7u);
  EXPECT_EQ(accepted[0].first.sequence, 2u);
  EXPECT_EQ(accepted[0].second.refused_operations, 0u);
  EXPECT_EQ(accepted[0].second.applied_time_ns, sim.clock.Now());
  EXPECT_THAT(accepted[0].second.displays, ElementsAre("main"));
  EXPECT_TRUE(client.sink->OutcomesOf(7).empty());

  sim.clock.Advance(5 * sync::kMillisecond);
  ASSERT_TRUE(sim.Show());
  const CommitOutcome outcome = Only(*client.sink, 7);
  EXPECT_EQ(outcome.kind, Kind::kPresented);
  EXPECT_EQ(outcome.display, "main");
  EXPECT_EQ(outcome.volume, 2u);  // the first was the dark one
  EXPECT_EQ(outcome.time_ns, sim.clock.Now());
  EXPECT_EQ(outcome.evidence, display::Evidence::kDevice);
  EXPECT_EQ(outcome.last_byte_ns, sim.clock.Now() - sync::kMillisecond);
  EXPECT_EQ(sim.engine().scene->drawables().size(), 1u);
  EXPECT_FALSE(sim.Show());  // nothing else was drawn
}

TEST(CoreReceipts, OfOneStreamsCommitsInOneVolumeTheNewestGetsTheOutcome) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(), other = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));  // in flight
  sim.Send(client, 2, Put("a", "x", 2));  // in the mailbox
  sim.Send(client, 3, Put("a", "x", 3));  // these wait for the next volume
  sim.Send(other, 30, Put("a", "x", 3));
  sim.Send(client, 4, Put("a", "x", 4));
  sim.Send(client, 5, Put("a", "x", 5));
  EXPECT_TRUE(client.sink->Of<CommitOutcome>().empty());
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kPresented);
  for (const uint64_t earlier : {3, 4}) {
    EXPECT_EQ(Only(*client.sink, earlier).kind, Kind::kSuperseded) << earlier;
  }
  EXPECT_EQ(Only(*client.sink, 4).by_frame_id, 5u);
  EXPECT_EQ(Only(*client.sink, 4).by_sequence, 10u);
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 2).kind, Kind::kPresented);
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 5).kind, Kind::kPresented);
  EXPECT_EQ(Only(*other.sink, 30).kind, Kind::kPresented);
  EXPECT_EQ(Only(*client.sink, 5).volume, Only(*other.sink, 30).volume);
  EXPECT_FALSE(sim.Show());
}

TEST(CoreReceipts, WhatLooksTheSameIsUnchangedOnceTheVolumeBeforeWasPresented) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1), SetLayer("h", false));
  sim.Send(client, 2, Put("a", "x", 1));  // equal content, another geometry
  sim.Send(client, 3);                    // nothing at all
  EXPECT_TRUE(client.sink->Of<CommitOutcome>().empty());
  ASSERT_TRUE(sim.Show());
  const CommitOutcome first = Only(*client.sink, 1);
  EXPECT_EQ(first.kind, Kind::kPresented);
  for (const uint64_t later : {2, 3}) {
    EXPECT_EQ(Only(*client.sink, later).kind, Kind::kUnchanged);
    EXPECT_EQ(Only(*client.sink, later).volume, first.volume);
  }
  EXPECT_FALSE(sim.Show());
  sim.Send(client, 4, Put("a", "x", 1));  // at once, when it has been presented already
  EXPECT_EQ(Only(*client.sink, 4).kind, Kind::kUnchanged);
  EXPECT_EQ(Only(*client.sink, 4).volume, first.volume);
}

TEST(CoreReceipts, WhatLooksLikeAVolumeThatIsLostIsLost) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Send(client, 2, Put("a", "x", 1));
  ASSERT_TRUE(sim.display().Abort("three slices missing"));
  sim.core->Step();
  for (const uint64_t frame : {1, 2}) {
    EXPECT_EQ(Only(*client.sink, frame).kind, Kind::kLost);
    EXPECT_EQ(Only(*client.sink, frame).reason, "three slices missing");
  }
  // The next one is sent although it looks the same as the lost one.
  sim.Send(client, 3, Put("a", "x", 1));
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 3).kind, Kind::kPresented);
}

TEST(CoreReceipts, HiddenCommitsAreNotShown) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, SetLayer("h", false), Put("h", "x"));
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kNotShown);
  EXPECT_EQ(Only(*client.sink, 1).why, NotShown::kHidden);
  // An entity that was inserted while its layer was hidden appears when the layer is shown.
  sim.Send(client, 2, SetLayer("h", true));
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 2).kind, Kind::kPresented);
  EXPECT_EQ(sim.engine().scene->drawables().size(), 1u);
}

TEST(CoreReceipts, AnAbsentDisplayShowsNothingAndTheSceneWhenItComes) {
  Simulation sim;
  sim.display().attach_at_once = false;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"));
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kNotShown);
  EXPECT_EQ(Only(*client.sink, 1).why, NotShown::kAbsent);
  sim.display().Attach();
  sim.core->Step();
  EXPECT_EQ(sim.engine().scene->drawables().size(), 1u);
  EXPECT_TRUE(sim.Show());
  EXPECT_FALSE(sim.Show());
}

TEST(CoreReceipts, ALossTakesWhatIsInFlightAndWhatWaits) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Send(client, 2, Put("a", "x", 2));
  sim.Send(client, 3, Put("a", "x", 3));
  sim.display().Lose("cable pulled");
  sim.core->Step();
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kLost);
  EXPECT_EQ(Only(*client.sink, 1).reason, "cable pulled");
  EXPECT_EQ(Only(*client.sink, 3).kind, Kind::kLost);
  EXPECT_THAT(Only(*client.sink, 3).reason, HasSubstr("cable pulled"));
  sim.Send(client, 4, Put("a", "x", 4));
  EXPECT_EQ(Only(*client.sink, 4).why, NotShown::kAbsent);
  EXPECT_TRUE(client.sink->OutcomesOf(2).empty());  // the display still has it

  sim.display().Attach();
  sim.core->Step();
  while (sim.Show()) {
  }
  EXPECT_EQ(Only(*client.sink, 2).kind, Kind::kPresented);
  const auto dots = sim.engine().scene->geometries();
  ASSERT_EQ(dots.size(), 1u);
  EXPECT_EQ(dots.begin()->second.positions[0], 4);  // the newest scene is shown
}

TEST(CoreReceipts, BlankingLosesWhatWaitsAndDarknessShowsNothing) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Send(client, 2, Put("a", "x", 2));
  sim.Send(client, 3, Put("a", "x", 3));
  DisplayUpdate blank;
  blank.blank = true;
  ASSERT_TRUE(sim.Update(blank).ok());
  for (const uint64_t frame : {1, 2, 3}) EXPECT_EQ(Only(*client.sink, frame).kind, Kind::kLost);
  sim.Send(client, 4, Put("a", "x", 4));
  EXPECT_EQ(Only(*client.sink, 4).why, NotShown::kBlanked);
  const size_t drawn = sim.engine().frames.size();
  sim.Show();
  EXPECT_EQ(sim.engine().frames.size(), drawn);
  blank.blank = false;
  ASSERT_TRUE(sim.Update(blank).ok());
  while (sim.Show()) {
  }
  EXPECT_EQ(sim.engine().scene->geometries().begin()->second.positions[0], 4);
  EXPECT_GT(sim.engine().frames.size(), drawn);
}

TEST(CoreReceipts, EveryDisplayGivesItsOwnOutcome) {
  Simulation sim({}, 2);
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"));
  EXPECT_THAT(client.sink->Of<Accepted>()[0].second.displays, ElementsAre("main", "display1"));
  sim.Show(1);
  ASSERT_EQ(client.sink->OutcomesOf(1).size(), 1u);
  EXPECT_EQ(client.sink->OutcomesOf(1)[0].display, "display1");
  sim.display(0).Lose("gone");
  sim.core->Step();
  ASSERT_EQ(client.sink->OutcomesOf(1).size(), 2u);
  EXPECT_EQ(client.sink->OutcomesOf(1)[1].display, "main");
  EXPECT_EQ(client.sink->OutcomesOf(1)[1].kind, Kind::kLost);
}

TEST(CoreReceipts, AStrictSessionsBadCommitIsRefusedWhole) {
  Simulation sim;
  sim.Start();
  OpenOptions strict;
  strict.strict = true;
  auto client = sim.Open(strict);
  sim.Send(client, 1, Put("a", "x"), testing::Move("a", "nobody", {}));
  const auto refused = client.sink->Of<Refused>();
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_EQ(refused[0].first.frame_id, 1u);
  EXPECT_EQ(refused[0].second.refused_operations, 1u);
  EXPECT_THAT(refused[0].second.message, HasSubstr("\"nobody\""));
  EXPECT_EQ(client.sink->receipts.size(), 1u);
  EXPECT_EQ(client.sink->issues.size(), 1u);
  EXPECT_EQ(sim.List().total, 0u);
  sim.Send(client, 2, Put("a", "x"));
  EXPECT_EQ(client.sink->Of<Accepted>().size(), 1u);
  EXPECT_EQ(sim.GetStats().commits_refused, 1u);
}

TEST(CoreReceipts, WithNoOutcomesACommitIsOnlyAccepted) {
  Simulation sim;
  sim.Start();
  OpenOptions options;
  options.no_outcomes = true;
  auto client = sim.Open(options);
  sim.Send(client, 1, Put("a", "x"));
  sim.Show();
  ASSERT_EQ(client.sink->receipts.size(), 1u);
  EXPECT_TRUE(client.sink->Of<Accepted>()[0].second.displays.empty());
  EXPECT_EQ(sim.GetStats().displays[0].commits_presented, 1u);
}

TEST(CoreReceipts, OutcomesOwedToAVanishedClientAreCounted) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"));
  sim.Close(client);
  const size_t receipts = client.sink->receipts.size();
  while (sim.Show()) {
  }
  EXPECT_EQ(client.sink->receipts.size(), receipts);
  EXPECT_EQ(sim.GetStats().outcomes_undelivered, 0u) << "kept for a while";
  sim.Advance(10 * sync::kSecond);
  const Stats stats = sim.GetStats();
  EXPECT_EQ(stats.outcomes_undelivered, 1u);
  EXPECT_EQ(stats.displays[0].commits_presented, 1u);
  EXPECT_EQ(stats.displays[0].commits_pending, 0u);
}

TEST(CoreReceipts, DecodingsRefusalsCountForTheCommitThatTheyComeBefore) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  std::vector<Operation> all = testing::Sequence(0, Put("a", "x"), testing::EndCommit(1),
                                                 Put("a", "y"), testing::EndCommit(2));
  all[0].sequence = 1;
  all[1].sequence = 4;
  all[2].sequence = 5;
  all[3].sequence = 9;
  std::vector<Issue> issues(3);
  issues[0].sequence = 2;
  issues[1].sequence = 7;
  issues[2].sequence = 10;
  client.info.intake->Take({std::move(all), {std::move(issues)}, 1});
  sim.core->Step();
  EXPECT_EQ(client.sink->issues.size(), 3u);
  const auto accepted = client.sink->Of<Accepted>();
  ASSERT_EQ(accepted.size(), 2u);
  EXPECT_EQ(accepted[0].second.refused_operations, 1u);
  EXPECT_EQ(accepted[1].second.refused_operations, 1u);
  sim.Send(client, 3);
  EXPECT_EQ(client.sink->Of<Accepted>()[2].second.refused_operations, 1u);
}

// -------------------------------------------------------------------------- engine failures

TEST(CoreReceipts, ALostEngineIsReplacedAndNothingElseIsLost) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"), Put("b", "y"));
  sim.Show();
  EXPECT_EQ(sim.engine().engines, 1);
  sim.engine().fail = absl::DataLossError("the worker died");
  sim.Send(client, 2, Put("a", "z"));
  EXPECT_EQ(sim.engine().engines, 2);
  EXPECT_EQ(sim.engine().scene->drawables().size(), 3u);
  EXPECT_EQ(sim.engine().targets.size(), 2u);
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 2).kind, Kind::kPresented);
}

TEST(CoreReceipts, AnEngineThatCannotBeReplacedIsTriedAgainLater) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.engine().fail = absl::DataLossError("the worker died");
  sim.make_engine_fails = absl::UnavailableError("no memory");
  sim.Send(client, 1, Put("a", "x"));
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kLost);
  EXPECT_THAT(Only(*client.sink, 1).reason, HasSubstr("the worker died"));
  sim.Send(client, 2, Put("a", "y"));
  EXPECT_THAT(Only(*client.sink, 2).reason, HasSubstr("no memory"));
  EXPECT_EQ(sim.GetStats().displays[0].engine_reason, "no memory");
  sim.make_engine_fails = absl::OkStatus();
  EXPECT_FALSE(sim.Show());
  sim.Advance(sync::kSecond);
  EXPECT_TRUE(sim.Show());
  EXPECT_EQ(sim.engine().scene->drawables().size(), 2u);
}

TEST(CoreReceipts, AFailedFrameIsLostAndTheEngineGetsTheWholeSceneNextTime) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.engine().fail = absl::InternalError("a kernel failed");
  sim.Send(client, 1, Put("a", "x"));
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kLost);
  EXPECT_THAT(Only(*client.sink, 1).reason, HasSubstr("a kernel failed"));
  sim.engine().fail_staging = true;
  sim.Send(client, 2, Put("a", "y"));
  EXPECT_THAT(Only(*client.sink, 2).reason, HasSubstr("no staging memory"));
  sim.Send(client, 3, Put("a", "z"));
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 3).kind, Kind::kPresented);
  EXPECT_EQ(sim.engine().scene->drawables().size(), 3u);
  EXPECT_EQ(sim.engine().engines, 1);
}

TEST(CoreReceipts, AVolumeThatIsLostDoesNotPutOffTheRetryOfAFailedFrame) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 1));  // in flight
  sim.engine().fail = absl::InternalError("a kernel failed");
  sim.Send(client, 2, Put("a", "x", 2));
  EXPECT_EQ(Only(*client.sink, 2).kind, Kind::kLost);
  ASSERT_TRUE(sim.display().Abort("three slices missing"));
  sim.core->Step();
  const size_t drawn = sim.engine().frames.size();
  sim.Advance(sync::kSecond);
  EXPECT_EQ(sim.engine().frames.size(), drawn + 1) << "without commits, the newest is still drawn";
  while (sim.Show()) {
  }
  EXPECT_EQ(sim.GetStats().displays[0].volumes_lost, 1u);
}

TEST(CoreReceipts, ASlowEngineNeverHoldsTheDisplayUp) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.engine().inline_calls = false;
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Send(client, 2, Put("a", "x", 2));
  sim.Send(client, 3, Put("a", "x", 3));
  EXPECT_FALSE(sim.Show());
  EXPECT_TRUE(client.sink->Of<CommitOutcome>().empty());
  ASSERT_TRUE(sim.engine().Run());
  sim.core->Step();  // hands the first over, and starts the next with everything that has come
  EXPECT_EQ(Only(*client.sink, 2).kind, Kind::kSuperseded);
  ASSERT_TRUE(sim.Show());
  EXPECT_EQ(Only(*client.sink, 1).kind, Kind::kPresented);
  sim.display().Lose("gone while it was drawn");
  sim.core->Step();
  sim.engine().Run();
  sim.core->Step();
  EXPECT_EQ(Only(*client.sink, 3).kind, Kind::kLost);
}

}  // namespace
}  // namespace voxeld::daemon
