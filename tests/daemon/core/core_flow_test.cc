// Tests must_show, present_at, credit and turns, with displays controlled by the test.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Begin;
using testing::End;
using ::testing::HasSubstr;
using testing::Put;
using testing::Simulation;
using ::testing::SizeIs;
using Kind = CommitOutcome::Kind;

Operation MustShow(uint64_t frame_id) {
  Operation commit = testing::EndCommit(frame_id);
  std::get<Commit>(commit.op).must_show = true;
  return commit;
}

Operation At(uint64_t frame_id, sync::TimeNs present_at) {
  Operation commit = testing::EndCommit(frame_id);
  std::get<Commit>(commit.op).present_at_ns = present_at;
  return commit;
}

uint64_t AcceptedOf(const Simulation::Client& client) { return client.sink->Of<Accepted>().size(); }

TEST(CoreFlow, MustShowHoldsTheStreamsLaterCommitsAndNobodyElses) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(), other = sim.Open();
  sim.Send(client, 0, Put("a", "x", 1), MustShow(1));
  sim.Send(client, 2, Put("a", "x", 2));
  sim.Send(other, 7, Put("b", "x", 3));
  EXPECT_EQ(AcceptedOf(client), 1u) << "the second waits";
  EXPECT_EQ(AcceptedOf(other), 1u);
  while (sim.Show()) {
  }
  EXPECT_EQ(AcceptedOf(client), 2u);
  while (sim.Show()) {
  }
  ASSERT_THAT(client.sink->OutcomesOf(1), SizeIs(1));
  EXPECT_EQ(client.sink->OutcomesOf(1)[0].kind, Kind::kPresented);
  EXPECT_EQ(client.sink->OutcomesOf(2)[0].kind, Kind::kPresented);
}

TEST(CoreFlow, MustShowWaitsForEveryDisplayAndGivesUpInTime) {
  Limits limits;
  limits.must_show_timeout_ns = 300 * sync::kMillisecond;
  Simulation sim(limits, 2);
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 0, Put("a", "x", 1), MustShow(1));
  sim.Send(client, 2, Put("a", "x", 2));
  EXPECT_TRUE(sim.Show(0));
  EXPECT_EQ(AcceptedOf(client), 1u) << "the other display has not reported";
  sim.Advance(300 * sync::kMillisecond - 1);
  EXPECT_EQ(AcceptedOf(client), 1u);
  sim.Advance(1);
  EXPECT_EQ(AcceptedOf(client), 2u);
  ASSERT_THAT(client.sink->issues, SizeIs(1));
  EXPECT_EQ(client.sink->issues[0].reason, Reason::kTimedOut);
  EXPECT_EQ(client.sink->issues[0].sequence, 2u);
  EXPECT_THAT(client.sink->issues[0].message, HasSubstr("display1"));
  EXPECT_EQ(sim.GetStats().must_show_timeouts, 1u);
}

TEST(CoreFlow, MustShowWithNoDisplayThatShowsHoldsNothing) {
  Simulation sim({}, 1);
  sim.display().attach_at_once = false;
  ASSERT_TRUE(sim.core->Start().ok());
  auto client = sim.Open();
  sim.Send(client, 0, Put("a", "x", 1), MustShow(1));
  sim.Send(client, 2, Put("a", "x", 2));
  EXPECT_EQ(AcceptedOf(client), 2u);
}

TEST(CoreFlow, ATimedCommitIsScheduledAndAppliedWhenDue) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  const sync::TimeNs at = sim.clock.Now() + sync::kSecond;
  sim.Send(client, 0, Put("a", "later", 1), At(1, at));
  sim.Send(client, 2, Put("a", "now", 2));
  ASSERT_THAT(client.sink->Of<Scheduled>(), SizeIs(1));
  EXPECT_EQ(client.sink->Of<Scheduled>()[0].second.present_at_ns, at);
  EXPECT_EQ(client.sink->Of<Scheduled>()[0].first.frame_id, 1u);
  EXPECT_EQ(AcceptedOf(client), 1u);
  EXPECT_EQ(sim.List().total, 1u);
  EXPECT_EQ(sim.GetStats().timed_pending, 1u);
  EXPECT_EQ(sim.core->Step(), at);
  sim.Advance(sync::kSecond - 1);
  EXPECT_EQ(sim.List().total, 1u);
  sim.Advance(1);
  EXPECT_EQ(sim.List().total, 2u);
  ASSERT_THAT(client.sink->Of<Accepted>(), SizeIs(2));
  EXPECT_EQ(client.sink->Of<Accepted>()[1].first.frame_id, 1u);
  EXPECT_FALSE(client.sink->Of<Accepted>()[1].second.late);
  while (sim.Show()) {
  }
  EXPECT_THAT(client.sink->OutcomesOf(1), SizeIs(1));
}

TEST(CoreFlow, ATimedCommitIsInTheFirstVolumeWhoseSweepStartsThenOrLater) {
  Simulation sim;
  sim.display().sweep_start_ns = sim.clock.Now();
  sim.display().sweep_period_ns = 100 * sync::kMillisecond;
  sim.Start();
  sim.core->Step();
  auto client = sim.Open();
  // Sweeps start at 0.1, 0.2, 0.3 …; wanted from 0.25 on, so in the sweep of 0.3: it must be drawn after 0.2 began.
  const sync::TimeNs zero = sim.display().sweep_start_ns;
  sim.Send(client, 0, Put("a", "x", 1), At(1, zero + 250 * sync::kMillisecond));
  sim.clock.AdvanceTo(zero + 200 * sync::kMillisecond);
  sim.core->Step();
  EXPECT_EQ(AcceptedOf(client), 0u) << "not before the sweep of 0.2 has certainly begun";
  sim.Advance(2 * sync::kMillisecond);
  EXPECT_EQ(AcceptedOf(client), 1u);
}

TEST(CoreFlow, APlainCommitIsDrawnAsLateAsItStillComesToTheNextSweep) {
  Simulation sim;
  sim.Start();
  const sync::TimeNs zero = sim.clock.Now();
  sim.display().sweep_start_ns = zero;
  sim.display().sweep_period_ns = 100 * sync::kMillisecond;
  auto client = sim.Open();
  const size_t drawn = sim.engine().frames.size();
  sim.Advance(10 * sync::kMillisecond);
  sim.Send(client, 1, Put("a", "x", 1));
  EXPECT_EQ(AcceptedOf(client), 1u) << "it is applied at once";
  sim.Advance(64 * sync::kMillisecond);
  sim.Send(client, 2, Put("a", "x", 2));
  EXPECT_EQ(sim.engine().frames.size(), drawn);
  sim.Advance(sync::kMillisecond);  // a quarter of a sweep before the next
  EXPECT_EQ(sim.engine().frames.size(), drawn + 1);
  EXPECT_TRUE(sim.Show());
  ASSERT_THAT(client.sink->OutcomesOf(1), SizeIs(1));
  EXPECT_EQ(client.sink->OutcomesOf(1)[0].kind, CommitOutcome::Kind::kSuperseded);
  ASSERT_THAT(client.sink->OutcomesOf(2), SizeIs(1));
  EXPECT_EQ(client.sink->OutcomesOf(2)[0].kind, CommitOutcome::Kind::kPresented);
}

TEST(CoreFlow, ADueCommitTakesThePlaceOfTheVolumeThatWaits) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(), other = sim.Open();
  sim.Send(other, 1, Put("b", "x", 1));  // in flight
  sim.Send(other, 2, Put("b", "x", 2));  // waits in the mailbox
  const sync::TimeNs at = sim.clock.Now() + sync::kMillisecond;
  sim.Send(client, 0, Put("a", "x", 3), At(9, at));
  sim.Advance(sync::kMillisecond);
  EXPECT_EQ(AcceptedOf(client), 1u);
  EXPECT_TRUE(sim.Show());  // of frame 1
  EXPECT_THAT(client.sink->OutcomesOf(9), SizeIs(0));
  EXPECT_TRUE(sim.Show());
  ASSERT_THAT(client.sink->OutcomesOf(9), SizeIs(1));
  ASSERT_THAT(other.sink->OutcomesOf(2), SizeIs(1));
  EXPECT_EQ(client.sink->OutcomesOf(9)[0].volume, other.sink->OutcomesOf(2)[0].volume);
}

TEST(CoreFlow, ALateCommitIsAppliedAtOnceAndMarked) {
  Simulation sim;
  sim.Start();
  sim.clock.Advance(sync::kSecond);
  auto client = sim.Open();
  sim.Send(client, 0, Put("a", "x", 1), At(1, sim.clock.Now() - 1));
  ASSERT_EQ(AcceptedOf(client), 1u);
  EXPECT_TRUE(client.sink->Of<Accepted>()[0].second.late);
  sim.Send(client, 0, Put("a", "x", 1), At(2, sim.clock.Now()));
  EXPECT_FALSE(client.sink->Of<Accepted>()[1].second.late);
}

TEST(CoreFlow, TimedCommitsAreLimitedInTimeAndNumber) {
  Limits limits;
  limits.max_present_at_horizon_ns = sync::kSecond;
  limits.max_timed_commits = 1;
  Simulation sim(limits);
  sim.Start();
  auto client = sim.Open();
  const sync::TimeNs now = sim.clock.Now();
  sim.Send(client, 0, Put("a", "x"), At(1, now + sync::kSecond + 1));
  sim.Send(client, 0, Put("a", "x"), At(2, now + sync::kSecond));
  sim.Send(client, 0, Put("a", "x"), At(3, now + sync::kSecond));
  const auto refused = client.sink->Of<Refused>();
  ASSERT_THAT(refused, SizeIs(2));
  EXPECT_EQ(refused[0].first.frame_id, 1u);
  EXPECT_EQ(refused[0].second.refused_operations, 1u);
  EXPECT_THAT(refused[0].second.message, HasSubstr("max_present_at_horizon_ns"));
  EXPECT_EQ(refused[1].first.frame_id, 3u);
  EXPECT_THAT(refused[1].second.message, HasSubstr("max_timed_commits"));
  ASSERT_THAT(client.sink->issues, SizeIs(2));
  EXPECT_EQ(client.sink->issues[0].field, "commit.present_at_ns");
  EXPECT_EQ(client.sink->issues[0].reason, Reason::kOutOfRange);
  EXPECT_EQ(client.sink->issues[1].reason, Reason::kQuotaExceeded);
  EXPECT_EQ(sim.GetStats().commits_refused, 2u);
}

TEST(CoreFlow, WhatIsNotDueWhenItsSessionEndsIsDroppedAndCounted) {
  Simulation sim;
  sim.Start();
  OpenOptions keep;
  keep.on_disconnect = DisconnectPolicy::kKeep;
  auto client = sim.Open(keep);
  sim.Send(client, 1, Put("a", "now"));
  sim.Send(client, 0, Put("a", "later"), At(2, sim.clock.Now() + sync::kSecond));
  EXPECT_GT(sim.GetStats().memory.waiting, 0u);
  sim.Close(client);
  EXPECT_EQ(sim.GetStats().timed_dropped, 1u);
  EXPECT_EQ(sim.GetStats().memory.waiting, 0u);
  sim.Advance(2 * sync::kSecond);
  EXPECT_EQ(sim.List().total, 1u);
}

TEST(CoreFlow, ACrowdedClientsCommitsWaitUntilItReads) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(), other = sim.Open();
  client.sink->crowded = true;
  sim.Send(client, 1, Put("a", "x"));
  sim.Send(other, 1, Put("a", "x"));
  EXPECT_EQ(AcceptedOf(client), 0u);
  EXPECT_EQ(AcceptedOf(other), 1u);
  client.sink->crowded = false;
  client.info.intake->Wake();
  sim.core->Step();
  EXPECT_EQ(AcceptedOf(client), 1u);
}

TEST(CoreFlow, WhatEnginesHoldCountsForTheLimit) {
  Limits limits;
  limits.max_memory_bytes = 10'000'000;
  Simulation sim(limits);
  sim.engine().memory_bytes = 9'990'000;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"));
  EXPECT_EQ(AcceptedOf(client), 1u);
  while (sim.Show()) {
  }
  EXPECT_GE(sim.GetStats().memory.engines, 9'990'000u);
  EXPECT_LT(sim.GetStats().memory.engines, 9'992'000u) << "an index of one entity";
  for (uint64_t i = 2; i <= 40; ++i) sim.Send(client, i, Put("a", std::to_string(i)));
  ASSERT_FALSE(client.sink->issues.empty());
  EXPECT_EQ(client.sink->issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_THAT(client.sink->issues[0].message, HasSubstr("max_memory_bytes"));

  // There is room again once an engine uses less memory.
  sim.engine().memory_bytes = 1000;
  sim.Send(client, 41, testing::DeleteAllMine());
  while (sim.Show()) {
  }
  EXPECT_LT(sim.GetStats().memory.engines, 3000u);
  client.sink->issues.clear();
  sim.Send(client, 42, Put("a", "again"));
  EXPECT_TRUE(client.sink->issues.empty());
  EXPECT_TRUE(sim.core->Stop(sync::kSecond).ok());
  EXPECT_EQ(sim.core->budget()->used_bytes(Budget::Use::kEngines), 0u);
}

TEST(CoreFlow, CommitsThatRideAreLimitedAndTheRestWaits) {
  Limits limits;
  limits.max_riding_commits = 3;
  Simulation sim(limits);
  sim.Start();
  auto client = sim.Open();
  // One is in flight, one waits in the mailbox, and one is shown with the next volume.
  for (uint64_t i = 1; i <= 6; ++i) sim.Send(client, i, Put("a", "x", static_cast<float>(i)));
  EXPECT_EQ(AcceptedOf(client), 3u);
  for (int i = 0; i < 20 && sim.Show(); ++i) {
  }
  EXPECT_EQ(AcceptedOf(client), 6u);
  EXPECT_EQ(client.sink->Of<CommitOutcome>().size(), 6u);
  EXPECT_EQ(sim.GetStats().memory.owed, 0u);
}

TEST(CoreFlow, SessionsTakeTurnsCommitByCommit) {
  Simulation sim({}, 0);
  sim.Start();
  auto one = sim.Open(), two = sim.Open();
  const auto send = [](Simulation::Client& client, uint64_t frame) {
    std::vector<Operation> all =
        testing::Sequence(client.last_sequence, Put("a", "x"), testing::EndCommit(frame));
    client.last_sequence += all.size();
    client.info.intake->Take({std::move(all), {}, 10});
  };
  for (uint64_t i = 1; i <= 5; ++i) send(one, i);
  for (uint64_t i = 1; i <= 5; ++i) send(two, i);
  sim.core->Step();
  std::vector<uint64_t> first, second;
  for (const auto& [receipt, accepted] : one.sink->Of<Accepted>())
    first.push_back(accepted.snapshot);
  for (const auto& [receipt, accepted] : two.sink->Of<Accepted>()) {
    second.push_back(accepted.snapshot);
  }
  EXPECT_EQ(first, (std::vector<uint64_t>{2, 4, 6, 8, 10}));
  EXPECT_EQ(second, (std::vector<uint64_t>{3, 5, 7, 9, 11}));
}

TEST(CoreFlow, AFrameGivenUpIsCountedAndItsCommitAnswered) {
  Simulation sim;
  sim.Start();
  OpenOptions latest;
  latest.flow = FlowPolicy::kLatest;
  auto client = sim.Open(latest);
  client.sink->crowded = true;  // so that commits wait
  for (uint64_t i = 1; i <= 3; ++i) {
    sim.Send(client, i, Begin("f"), Put("f", "x", static_cast<float>(i)), End("f"));
  }
  client.sink->crowded = false;
  client.info.intake->Wake();
  sim.core->Step();
  const auto accepted = client.sink->Of<Accepted>();
  ASSERT_THAT(accepted, SizeIs(3));
  EXPECT_EQ(accepted[0].second.dropped_frames, 1u);
  EXPECT_EQ(accepted[1].second.dropped_frames, 1u);
  EXPECT_EQ(accepted[2].second.dropped_frames, 0u);
  EXPECT_EQ(sim.GetStats().frames_dropped, 2u);
  while (sim.Show()) {
  }
  EXPECT_EQ(client.sink->Of<CommitOutcome>().size(), 3u);
}

TEST(CoreFlow, SendTimesThatNoClockHasAreNoTimes) {
  Simulation sim;
  sim.Start();
  sim.clock.Advance(sync::kSecond);
  auto client = sim.Open();
  const sync::TimeNs now = sim.clock.Now();
  constexpr int64_t kMost = std::numeric_limits<int64_t>::max();
  for (const int64_t time : {kMost, -kMost - 1, kMost - 5, int64_t{-1}, -kMost, int64_t{1}}) {
    Operation commit = testing::EndCommit(1);
    std::get<Commit>(commit.op).send_time_ns = time;
    std::vector<Operation> all = testing::Sequence(client.last_sequence, std::move(commit));
    client.last_sequence += all.size();
    client.info.intake->Take({std::move(all), {}, 10, now, now});
    sim.core->Step();
  }
  const auto accepted = client.sink->Of<Accepted>();
  ASSERT_THAT(accepted, SizeIs(6));
  for (const auto& [receipt, what] : accepted) {
    EXPECT_GE(what.stages.sent_ns, 0);
    EXPECT_LE(what.stages.sent_ns, now);
  }
}

TEST(CoreFlow, StagesAscendAndTheClientsClockIsFound) {
  Simulation sim;
  sim.Start();
  sim.clock.Advance(sync::kSecond);
  auto client = sim.Open();
  const sync::TimeNs now = sim.clock.Now();
  // A client whose clock is an hour ahead: the first message arrived 3 ms after it was sent, the
  // second 1 ms, the third 8 ms; so, as far as can be known, 2, 0 and 7.
  const int64_t ahead = 3600 * sync::kSecond;
  const auto send = [&](uint64_t frame, int64_t way_ms) {
    Operation commit = testing::EndCommit(frame);
    std::get<Commit>(commit.op).send_time_ns = now + ahead - way_ms * sync::kMillisecond;
    std::vector<Operation> all = testing::Sequence(
        client.last_sequence, Put("a", "x", static_cast<float>(frame)), std::move(commit));
    client.last_sequence += all.size();
    client.info.intake->Take({std::move(all), {}, 10, now, now});
    sim.core->Step();
  };
  send(1, 3);
  send(2, 1);
  send(3, 8);
  const auto accepted = client.sink->Of<Accepted>();
  ASSERT_THAT(accepted, SizeIs(3));
  EXPECT_EQ(accepted[0].second.stages.sent_ns, now);
  EXPECT_EQ(accepted[1].second.stages.sent_ns, now);
  EXPECT_EQ(accepted[2].second.stages.sent_ns, now - 7 * sync::kMillisecond);
  while (sim.Show()) {
  }
  const auto outcomes = client.sink->OutcomesOf(3);
  ASSERT_THAT(outcomes, SizeIs(1));
  const Stages& s = outcomes[0].stages;
  EXPECT_LE(s.sent_ns, s.received_ns);
  EXPECT_LE(s.received_ns, s.decoded_ns);
  EXPECT_LE(s.decoded_ns, s.applied_ns);
  EXPECT_LE(s.applied_ns, s.drawing_ns);
  EXPECT_LE(s.drawing_ns, s.assembled_ns);
  EXPECT_LE(s.assembled_ns, s.sliced_ns);
  EXPECT_EQ(s.shown_ns, outcomes[0].time_ns);
  EXPECT_EQ(s.transferred_ns, outcomes[0].last_byte_ns);
  const Stats stats = sim.GetStats();
  EXPECT_EQ(stats.sending.count, 3u);
  EXPECT_EQ(stats.sending.max_ns, 7 * sync::kMillisecond);
  EXPECT_EQ(stats.applying.count, 3u);
}

}  // namespace
}  // namespace voxeld::daemon
