// Tests resumed sessions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/core/scene_watch.h"
#include "daemon/core/token.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;
using testing::Put;
using testing::Simulation;
using ::testing::SizeIs;

OpenOptions Lingering(int64_t linger_ns = 5 * sync::kSecond) {
  OpenOptions options;
  options.on_disconnect = DisconnectPolicy::kLinger;
  options.linger_ns = linger_ns;
  return options;
}

OpenOptions Resuming(const Simulation::Client& client, OpenOptions options = Lingering()) {
  options.resume_token = client.info.resume_token;
  return options;
}

absl::Status TryOpen(Simulation& sim, OpenOptions options) {
  absl::Status status;
  sim.core->OpenSession(std::move(options), 0, std::make_shared<testing::RecordingSink>(),
                        [&](absl::StatusOr<SessionInfo> info) { status = info.status(); });
  sim.core->Step();
  return status;
}

TEST(CoreResume, TakesOverLayersAndIsToldTheLastCommit) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Lingering());
  EXPECT_EQ(client.info.resume_token.size(), kTokenBytes);
  EXPECT_FALSE(client.info.last_frame_id.has_value());
  sim.Send(client, 41, Put("a", "x"));
  sim.Send(client, 42, Put("a", "y"));
  sim.Close(client);
  EXPECT_TRUE(sim.List().layers[0].orphaned);
  EXPECT_EQ(sim.GetStats().sessions_dormant, 1u);

  auto again = sim.Open(Resuming(client));
  EXPECT_EQ(again.info.session, client.info.session);
  EXPECT_EQ(again.info.owner, client.info.owner);
  EXPECT_NE(again.info.resume_token, client.info.resume_token);
  EXPECT_EQ(again.info.last_frame_id, 42u);
  EXPECT_EQ(again.info.last_sequence, client.last_sequence);
  EXPECT_FALSE(sim.List().layers[0].orphaned);
  sim.Advance(3600 * sync::kSecond);
  EXPECT_EQ(sim.List().total, 2u) << "its layers no longer linger";
  EXPECT_EQ(sim.GetStats().sessions_resumed, 1u);
  EXPECT_EQ(sim.GetStats().sessions_dormant, 0u);
}

TEST(CoreResume, ATokenServesOnce) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Lingering());
  sim.Close(client);
  sim.Open(Resuming(client));
  const absl::Status status = TryOpen(sim, Resuming(client));
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(status.message(), HasSubstr("resume_token"));
}

TEST(CoreResume, EndsTheOldStreamAndAppliesWhatItHadSent) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Lingering());
  std::vector<Operation> all = testing::Sequence(0, Put("a", "x"), testing::EndCommit(3));
  client.info.intake->Take({std::move(all), {}, 10});  // not applied yet
  auto again = sim.Open(Resuming(client));
  ASSERT_TRUE(client.sink->ended.has_value());
  EXPECT_EQ(client.sink->ended->code(), absl::StatusCode::kAborted);
  EXPECT_EQ(again.info.last_frame_id, 3u);
  // The end of the old stream is reported later and has no effect.
  sim.Close(client);
  EXPECT_EQ(sim.GetStats().sessions, 1u);
  EXPECT_EQ(sim.List().total, 1u);
  sim.Send(again, 4, Put("a", "y"));
  EXPECT_EQ(sim.List().total, 2u);
}

TEST(CoreResume, WhatEndsOneStreamForAnotherLeavesItsLayers) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();  // CLEAR
  sim.Send(client, 1, Put("a", "x"));
  auto again = sim.Open(Resuming(client, {}));
  EXPECT_EQ(sim.List().total, 1u);
  EXPECT_EQ(sim.core->scene_watch().newest()->total.drawables, 1u) << "as watchers see it";
  sim.Close(again);
  EXPECT_EQ(sim.List().total, 0u) << "it ends with its own policy";
}

TEST(CoreResume, OutcomesOwedComeToTheNewStream) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Lingering());
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Send(client, 2, Put("a", "x", 2));
  sim.Close(client);
  sim.Show();  // of frame 1, while no client is connected
  auto again = sim.Open(Resuming(client));
  ASSERT_THAT(again.sink->OutcomesOf(1), SizeIs(1));
  EXPECT_THAT(again.sink->OutcomesOf(2), SizeIs(0));
  while (sim.Show()) {
  }
  EXPECT_THAT(again.sink->OutcomesOf(2), SizeIs(1));
  EXPECT_THAT(again.sink->OutcomesOf(1), SizeIs(1));
  EXPECT_EQ(sim.GetStats().outcomes_undelivered, 0u);
  EXPECT_EQ(sim.GetStats().memory.owed, 0u);
}

TEST(CoreResume, OutcomesThatAStreamCouldNotDeliverComeToTheNewOne) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Lingering());
  sim.Send(client, 1, Put("a", "x", 1));
  while (sim.Show()) {
  }
  const std::vector<Receipt> all = client.sink->receipts;  // Accepted and the outcome
  ASSERT_THAT(all, SizeIs(2));
  sim.Close(client);
  sim.core->GiveBack(client.info.session, all);
  auto again = sim.Open(Resuming(client));
  EXPECT_THAT(again.sink->OutcomesOf(1), SizeIs(1));
  EXPECT_THAT(again.sink->receipts, SizeIs(1)) << "Accepted is implied by last_frame_id";
}

TEST(CoreResume, AfterTenSecondsOutcomesAreCountedAsUndelivered) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Lingering(60 * sync::kSecond));
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Close(client);
  while (sim.Show()) {
  }
  EXPECT_GT(sim.GetStats().memory.owed, 0u);
  sim.Advance(10 * sync::kSecond);
  EXPECT_EQ(sim.GetStats().outcomes_undelivered, 1u);
  EXPECT_EQ(sim.GetStats().memory.owed, 0u);
  auto again = sim.Open(Resuming(client));
  EXPECT_THAT(again.sink->receipts, SizeIs(0));
  EXPECT_EQ(again.info.last_frame_id, 1u);
}

TEST(CoreResume, ATokenIsVoidWhenItsLayersAreGoneAndItsTimeIsOver) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();  // CLEAR
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Close(client);
  sim.Advance(10 * sync::kSecond);
  EXPECT_EQ(TryOpen(sim, Resuming(client)).code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(sim.GetStats().sessions_dormant, 0u);
}

TEST(CoreResume, AClearedSessionIsTakenUpWithItsOwner) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();  // CLEAR
  sim.Send(client, 9, Put("a", "x", 1));
  sim.Close(client);
  EXPECT_EQ(sim.List().total, 0u);
  auto again = sim.Open(Resuming(client, {}));
  EXPECT_EQ(again.info.session, client.info.session);
  EXPECT_EQ(again.info.owner, client.info.owner);
  EXPECT_EQ(again.info.owner_token, client.info.owner_token);
  EXPECT_EQ(again.info.last_frame_id, 9u);
  sim.Send(again, 10, Put("a", "x", 1));
  EXPECT_EQ(sim.List().total, 1u);
}

TEST(CoreResume, WhoIsToldNoTokenLeavesNothingBehind) {
  Simulation sim;
  sim.Start();
  OpenOptions once;
  once.on_disconnect = DisconnectPolicy::kKeep;
  once.resumable = false;
  auto client = sim.Open(once);
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Close(client);
  EXPECT_EQ(sim.GetStats().sessions_dormant, 0u);
  EXPECT_EQ(sim.List().total, 1u);
  EXPECT_EQ(TryOpen(sim, Resuming(client)).code(), absl::StatusCode::kNotFound);
}

TEST(CoreResume, KeptLayersKeepTheirToken) {
  Simulation sim;
  sim.Start();
  OpenOptions keep;
  keep.on_disconnect = DisconnectPolicy::kKeep;
  auto client = sim.Open(keep);
  sim.Send(client, 1, Put("a", "x", 1));
  sim.Close(client);
  sim.Advance(1'000'000 * sync::kSecond);
  auto again = sim.Open(Resuming(client, keep));
  EXPECT_EQ(again.info.session, client.info.session);
}

TEST(CoreResume, DormantSessionsAreLimitedInNumber) {
  Limits limits;
  limits.max_sessions = 2;
  Simulation sim(limits);
  sim.Start();
  std::vector<Simulation::Client> clients;
  for (int i = 0; i < 3; ++i) {
    clients.push_back(sim.Open(Lingering((10 + i) * sync::kSecond)));
    sim.Send(clients.back(), 1, Put("a", "x", 1));
    sim.Close(clients.back());
  }
  EXPECT_EQ(sim.GetStats().sessions_dormant, 2u);
  EXPECT_EQ(TryOpen(sim, Resuming(clients[0])).code(), absl::StatusCode::kNotFound)
      << "the one that would have ended first";
  EXPECT_TRUE(TryOpen(sim, Resuming(clients[2])).ok());
}

TEST(CoreResume, ADormantSessionThatMakesRoomForOneOfItsOwnerLeavesTheOwner) {
  Limits limits;
  limits.max_sessions = 2;
  Simulation sim(limits);
  sim.Start();
  auto one = sim.Open();
  OpenOptions joining;
  joining.owner_token = one.info.owner_token;
  auto two = sim.Open(joining);
  sim.Close(one);
  auto other = sim.Open();
  sim.Close(other);
  sim.Close(two);  // in the place of `one`
  auto again = sim.Open(Resuming(two, {}));
  EXPECT_EQ(again.info.session, two.info.session);
  EXPECT_EQ(again.info.owner, one.info.owner);
  EXPECT_EQ(again.info.owner_token, one.info.owner_token);
}

}  // namespace
}  // namespace voxeld::daemon
