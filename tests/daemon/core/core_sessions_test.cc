// Tests sessions, what they leave behind, and limits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Dots;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::Put;
using testing::Simulation;

OpenOptions Policy(DisconnectPolicy policy, int64_t linger_ns = 0) {
  OpenOptions options;
  options.client_name = "someone";
  options.on_disconnect = policy;
  options.linger_ns = linger_ns;
  return options;
}

Cleared Clear(Simulation& sim, uint64_t owner, std::string layer, bool keep_state = false) {
  Cleared cleared;
  sim.core->ClearLayer(owner, std::move(layer), keep_state, {}, [&](auto c) { cleared = *c; });
  sim.core->Step();
  return cleared;
}

TEST(CoreSessions, OneVanishesAndTheOthersLayerIsUntouched) {
  Simulation sim;
  sim.Start();
  auto one = sim.Open(), other = sim.Open();
  EXPECT_NE(one.info.owner, other.info.owner);
  sim.Send(one, 1, Put("a", "x"));
  sim.Send(other, 2, Put("a", "x"), Put("b", "y"));
  // In the middle of a draw batch, without a commit.
  sim.Send(one, 0, testing::Begin("a"), Put("a", "half"));
  sim.Close(one);
  const EntityPage page = sim.List();
  EXPECT_EQ(page.total, 2u);
  for (const LayerInfo& layer : page.layers) {
    EXPECT_EQ(layer.owner, other.info.owner);
    EXPECT_FALSE(layer.orphaned);
  }
  while (sim.Show()) {
  }
  EXPECT_EQ(sim.engine().scene->drawables().size(), 2u);
  EXPECT_EQ(other.sink->OutcomesOf(2).size(), 1u);
  EXPECT_EQ(sim.GetStats().sessions, 1u);
  sim.Send(other, 3, Put("b", "z"));
  EXPECT_EQ(sim.List().total, 3u);
}

TEST(CoreSessions, LingeringLayersGoAfterTheirTime) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(Policy(DisconnectPolicy::kLinger, 3 * sync::kSecond));
  sim.Send(client, 1, Put("a", "x"));
  sim.Close(client);
  EXPECT_TRUE(sim.List().layers[0].orphaned);
  EXPECT_EQ(sim.core->Step(), sim.clock.Now() + 3 * sync::kSecond);
  sim.Advance(3 * sync::kSecond - 1);
  EXPECT_EQ(sim.List().total, 1u);
  sim.Advance(1);
  EXPECT_EQ(sim.List().layers.size(), 0u);
  while (sim.Show()) {
  }
  EXPECT_TRUE(sim.engine().scene->drawables().empty());
}

TEST(CoreSessions, TheLongestLingerIsForEver) {
  Simulation sim;
  sim.Start();
  sim.clock.Advance(sync::kSecond);
  auto client = sim.Open(Policy(DisconnectPolicy::kLinger, INT64_MAX));
  sim.Send(client, 1, Put("a", "x"));
  sim.Close(client);
  sim.Advance(3600 * sync::kSecond);
  EXPECT_EQ(sim.List().total, 1u);
}

TEST(CoreSessions, KeptLayersStayAsOrphansUntilCleared) {
  Simulation sim;
  sim.Start();
  auto first = sim.Open(Policy(DisconnectPolicy::kKeep));
  sim.Send(first, 1, testing::Define("o", {{Dots(1), {}}}),
           testing::PutInstance("voxelctl", "x", "o"), Put("other", "y"));
  sim.Close(first);
  sim.Advance(3600 * sync::kSecond);
  const EntityPage kept = sim.List();
  ASSERT_EQ(kept.layers.size(), 2u);
  EXPECT_TRUE(kept.layers[0].orphaned);
  EXPECT_EQ(kept.layers[0].client_name, "someone");
  EXPECT_EQ(sim.GetStats().owners, 1u);

  // A new session is a new owner; clearing by name makes room for it.
  auto second = sim.Open(Policy(DisconnectPolicy::kKeep));
  EXPECT_EQ(Clear(sim, 0, "voxelctl").layers, 1u);
  sim.Send(second, 2, Put("voxelctl", "z"));
  EXPECT_EQ(sim.List().total, 2u);
  EXPECT_EQ(sim.GetStats().objects, 1u);  // its owner has a layer left
  EXPECT_EQ(Clear(sim, first.info.owner, "").entities, 1u);
  EXPECT_EQ(sim.GetStats().objects, 0u);
  EXPECT_EQ(sim.List().total, 1u);
}

TEST(CoreSessions, ClearingMayKeepALayersState) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"), testing::SetLayer("a", false), Put("b", "y"));
  EXPECT_EQ(Clear(sim, 0, "a", true).entities, 1u);
  const EntityPage page = sim.List();
  ASSERT_EQ(page.layers.size(), 2u);
  EXPECT_FALSE(page.layers[0].visible);
  EXPECT_EQ(page.layers[0].entities, 0u);
  EXPECT_EQ(Clear(sim, 77, "").layers, 0u);
  EXPECT_EQ(Clear(sim, 0, "").layers, 2u);
}

TEST(CoreSessions, ObjectsGoWithTheirOwner) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, testing::Define("o", {{Dots(1), {}}}));
  EXPECT_EQ(sim.GetStats().objects, 1u);
  sim.Close(client);
  const Stats stats = sim.GetStats();
  EXPECT_EQ(stats.objects, 0u);
  EXPECT_EQ(stats.owners, 0u);
  EXPECT_EQ(stats.scene_bytes, 0u);
}

TEST(CoreSessions, LifetimesEndByThemselvesAndWithoutReceipt) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  EntityData brief = Entity1(Dots(1));
  brief.lifetime_ns = 2 * sync::kSecond;
  sim.Send(client, 1, Put("a", "x", brief), Put("a", "y"));
  EXPECT_EQ(sim.List().entities[0].expires_ns, sim.clock.Now() + 2 * sync::kSecond);
  sim.Show();
  EXPECT_EQ(sim.core->Step(), sim.clock.Now() + 2 * sync::kSecond);
  const size_t receipts = client.sink->receipts.size();
  sim.Advance(2 * sync::kSecond);
  EXPECT_EQ(sim.List().total, 1u);
  EXPECT_TRUE(sim.Show());
  EXPECT_EQ(sim.engine().scene->drawables().size(), 1u);
  EXPECT_EQ(client.sink->receipts.size(), receipts);
}

TEST(CoreSessions, NoMoreThanMaxSessions) {
  Limits limits;
  limits.max_sessions = 2;
  Simulation sim(limits);
  sim.Start();
  auto first = sim.Open();
  sim.Open();
  absl::Status status;
  sim.core->OpenSession({}, 0, std::make_shared<testing::RecordingSink>(),
                        [&](absl::StatusOr<SessionInfo> info) { status = info.status(); });
  sim.core->Step();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(status.message(), HasSubstr("max_sessions"));
  sim.Close(first);
  EXPECT_NE(sim.Open().info.session, 0u);
}

TEST(CoreSessions, WhatWaitsForACommitIsLimited) {
  Limits limits;
  limits.max_operations_per_commit = 3;
  limits.max_uncommitted_bytes = 10000;
  Simulation sim(limits);
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 0, Put("a", "1"), Put("a", "2"), Put("a", "3"), Put("a", "4"));
  ASSERT_EQ(client.sink->issues.size(), 1u);  // at once, before the commit
  EXPECT_EQ(client.sink->issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_EQ(client.sink->issues[0].id, "4");
  EXPECT_EQ(client.sink->issues[0].field, "upsert");
  EXPECT_EQ(client.sink->issues[0].sequence, 4u);
  sim.Send(client, 1);
  EXPECT_EQ(client.sink->Of<Accepted>()[0].second.refused_operations, 1u);
  EXPECT_EQ(sim.List().total, 3u);

  sim.Send(client, 0, Put("a", "big", Entity1(Dots(0, 1, 900))));
  EXPECT_EQ(client.sink->issues.size(), 2u);
  EXPECT_THAT(client.sink->issues[1].message, HasSubstr("max_uncommitted_bytes is 10000"));
  sim.Send(client, 2, Put("a", "5"), Put("a", "6"), Put("a", "7"));
  EXPECT_EQ(client.sink->Of<Accepted>()[1].second.refused_operations, 1u);
  EXPECT_EQ(sim.List().total, 6u);
}

TEST(CoreSessions, AStrictSessionIsToldWhichOperationWasOneTooMany) {
  Limits limits;
  limits.max_operations_per_commit = 1;
  Simulation sim(limits);
  sim.Start();
  OpenOptions options;
  options.strict = true;
  auto client = sim.Open(options);
  sim.Send(client, 1, Put("a", "1"), testing::Begin("a"));
  ASSERT_EQ(client.sink->Of<Refused>().size(), 1u);
  EXPECT_THAT(
      client.sink->Of<Refused>()[0].second.message,
      HasSubstr("strict and 1 operation was refused, so nothing of the commit was applied; the "
                "first: a, frame_begin: 1 operation waits for a commit"));
}

TEST(CoreSessions, WhatWaitsForACommitIsLimitedOverAllSessions) {
  Limits limits;
  limits.max_uncommitted_bytes_total = 10000;
  Simulation sim(limits);
  sim.Start();
  auto one = sim.Open(), other = sim.Open(), third = sim.Open();
  const auto put = [] { return Put("a", "big", Entity1(Dots(0, 1, 500))); };  // 6000 bytes
  sim.Send(one, 0, put());
  sim.Send(other, 0, put());
  EXPECT_TRUE(one.sink->issues.empty());
  ASSERT_EQ(other.sink->issues.size(), 1u);
  EXPECT_EQ(other.sink->issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_THAT(other.sink->issues[0].message, HasSubstr("max_uncommitted_bytes_total is 10000"));
  sim.Send(one, 1);  // makes room,
  sim.Send(other, 0, put());
  EXPECT_EQ(other.sink->issues.size(), 1u);
  sim.Close(other);  // and so does a client that leaves
  sim.Send(third, 2, put());
  EXPECT_TRUE(third.sink->issues.empty());
}

TEST(CoreSessions, OfManyRefusalsTheFirstAreToldAndTheOthersCounted) {
  Limits limits;
  limits.max_issues_per_commit = 3;
  Simulation sim(limits);
  sim.Start();
  auto client = sim.Open();
  const auto singular = [] { return Put("a", "x", Entity1(Dots(0), testing::Scale(1, 0, 1))); };
  const auto unknown = [] { return testing::Move("a", "nobody", testing::Shift(1)); };
  // Two on arrival, three at the commit.
  sim.Send(client, 1, singular(), singular(), unknown(), unknown(), unknown(), Put("a", "good"));
  ASSERT_EQ(client.sink->issues.size(), 4u);
  EXPECT_EQ(client.sink->issues[2].reason, Reason::kNotFound);
  EXPECT_EQ(client.sink->issues[3].field, "commit");
  EXPECT_EQ(client.sink->issues[3].sequence, 7u);
  EXPECT_EQ(client.sink->issues[3].reason, Reason::kQuotaExceeded);
  EXPECT_THAT(client.sink->issues[3].message, HasSubstr("2 more issues are left out"));
  EXPECT_THAT(client.sink->issues[3].message, HasSubstr("the 3 of max_issues_per_commit"));
  EXPECT_EQ(client.sink->Of<Accepted>()[0].second.refused_operations, 5u);
  EXPECT_EQ(sim.List().total, 1u);

  // Each commit counts from zero; operations that decoding left out are counted too.
  Refusals refused;
  for (int i = 0; i < 5; ++i)
    refused.Add({8, "a", "y", "upsert", Reason::kInvalidValue, "wrong"}, 2);
  client.info.intake->Take({{}, refused, 100});
  sim.core->Step();
  EXPECT_EQ(client.sink->issues.size(), 6u);
  client.last_sequence = 8;
  sim.Send(client, 2, unknown(), unknown());
  ASSERT_EQ(client.sink->issues.size(), 8u);
  EXPECT_THAT(client.sink->issues[7].message, HasSubstr("4 more issues are left out"));
  EXPECT_EQ(client.sink->Of<Accepted>()[1].second.refused_operations, 7u);
  sim.Send(client, 3, Put("a", "good"));
  EXPECT_EQ(client.sink->issues.size(), 8u);
}

TEST(CoreSessions, WhatIsWrongInItselfIsRefusedOnArrival) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 0, Put("a", "x", Entity1(Dots(0), testing::Scale(1, 0, 1))));
  ASSERT_EQ(client.sink->issues.size(), 1u);
  EXPECT_EQ(client.sink->issues[0].reason, Reason::kSingularTransform);
}

TEST(CoreSessions, CoordinatesAreCheckedAgainstTheViewsThatThereAre) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x", 2e8f));  // FIT: 4 voxels a unit
  EXPECT_EQ(client.sink->issues.size(), 0u);
  sim.Send(client, 2, Put("a", "x", 3e8f));
  ASSERT_EQ(client.sink->issues.size(), 1u);
  EXPECT_THAT(client.sink->issues[0].message, HasSubstr("on display \"main\""));
  DisplayUpdate voxels;
  voxels.view = ViewOptions{ViewOptions::Mode::kVoxels, {}, {}};
  ASSERT_TRUE(sim.Update(voxels).ok());
  sim.Send(client, 3, Put("a", "x", 3e8f));
  EXPECT_EQ(client.sink->issues.size(), 1u);
}

TEST(CoreSessions, UnknownSessionsAreIgnoredAndDoneAlwaysComes) {
  Simulation sim;
  sim.Start();
  int done = 0;
  sim.core->CloseSession(99, 0, false, [&] { ++done; });
  sim.core->Step();
  EXPECT_EQ(done, 1);
  EXPECT_EQ(sim.List().total, 0u);
  EXPECT_TRUE(sim.core->Stop(sync::kSecond).ok());
  sim.core->CloseSession(99, 0, false, [&] { ++done; });
  EXPECT_EQ(done, 2);
}

}  // namespace
}  // namespace voxeld::daemon
