// Tests owners with several sessions, and the actions of operators.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using ::testing::HasSubstr;
using testing::Put;
using testing::Simulation;
using ::testing::SizeIs;

std::vector<OwnerInfo> Owners(Simulation& sim) {
  std::vector<OwnerInfo> owners;
  sim.core->ListOwners([&](auto answer) { owners = *answer; });
  sim.core->Step();
  return owners;
}

absl::StatusOr<OwnerInfo> Control(Simulation& sim, const OwnerControl& control) {
  absl::StatusOr<OwnerInfo> info = absl::UnknownError("no answer");
  sim.core->ControlOwner(control, [&](auto answer) { info = answer; });
  sim.core->Step();
  return info;
}

OpenOptions Joining(const Simulation::Client& client) {
  OpenOptions options;
  options.owner_token = client.info.owner_token;
  return options;
}

TEST(CoreOwners, SessionsOfOneOwnerShareItsNamesAndItsQuota) {
  Limits limits;
  limits.max_entities_per_owner = 3;
  Simulation sim(limits);
  sim.Start();
  auto one = sim.Open();
  auto two = sim.Open(Joining(one));
  EXPECT_EQ(two.info.owner, one.info.owner);
  EXPECT_NE(two.info.session, one.info.session);
  sim.Send(one, 1, Put("a", "x"), Put("a", "y"));
  sim.Send(two, 1, Put("a", "x"), Put("b", "z"), Put("b", "over"));
  EXPECT_EQ(sim.List().total, 3u);
  ASSERT_THAT(two.sink->issues, SizeIs(1));
  EXPECT_EQ(two.sink->issues[0].id, "over");
  const auto owners = Owners(sim);
  ASSERT_THAT(owners, SizeIs(1));
  EXPECT_EQ(owners[0].sessions, 2u);
  EXPECT_EQ(owners[0].entities, 3u);
  // A layer belongs to the session that last wrote it.
  sim.Close(one);
  EXPECT_EQ(sim.List().total, 3u);
  sim.Close(two);
  EXPECT_EQ(sim.List().total, 0u);
}

TEST(CoreOwners, ATokenIsVoidWhenNothingOfItsOwnerIsLeft) {
  Simulation sim;
  sim.Start();
  auto one = sim.Open();
  sim.Close(one);
  sim.Advance(10 * sync::kSecond);
  EXPECT_THAT(Owners(sim), SizeIs(0));
  absl::Status status;
  sim.core->OpenSession(Joining(one), 0, one.sink, [&](auto info) { status = info.status(); });
  sim.core->Step();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(status.message(), HasSubstr("owner_token"));
}

TEST(CoreOwners, HidingHidesAllLayersAndThoseToComeAndTellsCommits) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open(), other = sim.Open();
  sim.Send(client, 1, Put("a", "x"));
  sim.Send(other, 1, Put("o", "x"));
  while (sim.Show()) {
  }
  OwnerControl hide;
  hide.owner = client.info.owner;
  hide.hidden = true;
  ASSERT_TRUE(Control(sim, hide).ok());
  sim.Send(client, 2, Put("new", "y"));
  while (sim.Show()) {
  }
  ASSERT_THAT(client.sink->OutcomesOf(2), SizeIs(1));
  EXPECT_EQ(client.sink->OutcomesOf(2)[0].kind, CommitOutcome::Kind::kNotShown);
  EXPECT_EQ(client.sink->OutcomesOf(2)[0].why, CommitOutcome::NotShown::kHidden);
  int visible = 0;
  for (const auto& [id, layer] : sim.engine().scene->layers()) visible += layer.visible != 0;
  EXPECT_EQ(visible, 1) << "the other's";
  EXPECT_TRUE(Owners(sim)[0].hidden);
  for (const LayerInfo& layer : sim.List().layers)
    EXPECT_TRUE(layer.visible) << "by its own request";

  hide.hidden = false;
  ASSERT_TRUE(Control(sim, hide).ok());
  while (sim.Show()) {
  }
  visible = 0;
  for (const auto& [id, layer] : sim.engine().scene->layers()) visible += layer.visible != 0;
  EXPECT_EQ(visible, 3);
}

TEST(CoreOwners, ACapKeepsWhatIsThereAndAddsNothing) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"), Put("a", "y"));
  OwnerControl cap;
  cap.owner = client.info.owner;
  cap.max_entities = 1;
  const auto info = Control(sim, cap);
  ASSERT_TRUE(info.ok());
  EXPECT_EQ(info->max_entities, 1u);
  EXPECT_EQ(sim.List().total, 2u);
  sim.Send(client, 2, Put("a", "z"), Put("a", "x", 5));
  EXPECT_EQ(sim.List().total, 2u);
  ASSERT_THAT(client.sink->issues, SizeIs(1));
  EXPECT_EQ(client.sink->issues[0].id, "z");
  cap.max_entities = 0;
  ASSERT_TRUE(Control(sim, cap).ok());
  sim.Send(client, 3, Put("a", "z"));
  EXPECT_EQ(sim.List().total, 3u);
  cap.max_bytes = Limits().max_bytes_per_owner + 1;
  EXPECT_EQ(Control(sim, cap).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(CoreOwners, EvictingEndsEverythingOfTheOwner) {
  Simulation sim;
  sim.Start();
  OpenOptions keep;
  keep.on_disconnect = DisconnectPolicy::kKeep;
  auto client = sim.Open(keep), other = sim.Open();
  auto gone = sim.Open([&] {
    OpenOptions options = Joining(client);
    options.on_disconnect = DisconnectPolicy::kKeep;
    return options;
  }());
  sim.Send(client, 1, Put("a", "x"), testing::Define("ball", {{testing::Dots(1), {}}}));
  sim.Send(gone, 1, Put("g", "x"));
  sim.Send(other, 1, Put("o", "x"));
  sim.Close(gone);
  OwnerControl evict;
  evict.owner = client.info.owner;
  evict.evict = true;
  const auto was = Control(sim, evict);
  ASSERT_TRUE(was.ok());
  EXPECT_EQ(was->entities, 2u);
  ASSERT_TRUE(client.sink->ended.has_value());
  EXPECT_EQ(client.sink->ended->code(), absl::StatusCode::kPermissionDenied);
  EXPECT_FALSE(other.sink->ended.has_value());
  const Stats stats = sim.GetStats();
  EXPECT_EQ(stats.sessions, 1u);
  EXPECT_EQ(stats.entities, 1u);
  EXPECT_EQ(stats.objects, 0u);
  EXPECT_EQ(stats.sessions_dormant, 0u);
  EXPECT_THAT(Owners(sim), SizeIs(1));
  EXPECT_EQ(Control(sim, evict).status().code(), absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace voxeld::daemon
