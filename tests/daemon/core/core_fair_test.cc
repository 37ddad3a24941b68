// Owners take turns: a large commit, many commits or many sessions of one owner do not delay the
// others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::EndCommit;
using ::testing::HasSubstr;
using testing::Put;
using testing::Simulation;

constexpr int kLarge = 20'000;  // operations; many slices

// Passes a commit of that many entities without letting the core run.
void Hand(Simulation::Client& client, int entities, const std::string& layer = "a") {
  std::vector<Operation> all;
  for (int i = 0; i < entities; ++i) all.push_back(Put(layer, absl::StrCat(i)));
  all.push_back(EndCommit(1));
  for (Operation& operation : all) operation.sequence = ++client.last_sequence;
  client.info.intake->Take({std::move(all), {}, 100});
}

// Passes a large commit and lets the core apply its first slice.
void BeginLarge(Simulation& sim, Simulation::Client& client) {
  Hand(client, kLarge);
  sim.core->Turn(0);
  sim.core->Turn(0);
}

// Opens another session of the client's owner.
Simulation::Client OpenAgain(Simulation& sim, const Simulation::Client& client) {
  OpenOptions same;
  same.owner_token = client.info.owner_token;
  return sim.Open(same);
}

size_t CommitsAccepted(const Simulation::Client& client) {
  return client.sink->Of<Accepted>().size();
}

// Returns the number of turns of the core's thread until that many commits of `client` are
// accepted.
int TurnsUntil(Simulation& sim, const Simulation::Client& client, size_t accepted) {
  int turns = 0;
  while (CommitsAccepted(client) < accepted && turns < 1000) {
    sim.core->Turn(0);
    ++turns;
  }
  return turns;
}

TEST(CoreFair, ASmallCommitPassesAnothersLargeOne) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open(), small = sim.Open();
  BeginLarge(sim, large);
  Hand(small, 1, "b");
  EXPECT_LE(TurnsUntil(sim, small, 1), 3);
  EXPECT_EQ(CommitsAccepted(large), 0u);
  sim.core->Step();
  EXPECT_EQ(sim.List().total, kLarge + 1u);
  EXPECT_EQ(CommitsAccepted(large), 1u);
  EXPECT_LT(small.sink->Of<Accepted>()[0].second.snapshot,
            large.sink->Of<Accepted>()[0].second.snapshot);
}

TEST(CoreFair, ManySessionsOfOneOwnerGetOneTurnBetweenThem) {
  Simulation sim;
  sim.Start();
  std::vector<Simulation::Client> many = {sim.Open()};
  while (many.size() < 50) many.push_back(OpenAgain(sim, many[0]));
  auto other = sim.Open();
  for (auto& client : many) {
    for (int i = 0; i < 3; ++i) Hand(client, 1, absl::StrCat("a", client.info.session));
  }
  Hand(other, 1, "b");
  EXPECT_LE(TurnsUntil(sim, other, 1), 3);
  sim.core->Step();
  for (auto& client : many) EXPECT_EQ(CommitsAccepted(client), 3u);
}

TEST(CoreFair, AnOwnersOtherSessionsWaitForItsLargeCommit) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open();
  auto second = OpenAgain(sim, large);
  BeginLarge(sim, large);
  Hand(second, 1);  // replaces one of the others
  Hand(large, 2, "c");
  sim.core->Step();
  ASSERT_EQ(CommitsAccepted(large), 2u);
  ASSERT_EQ(CommitsAccepted(second), 1u);
  EXPECT_LT(large.sink->Of<Accepted>()[0].second.snapshot,
            second.sink->Of<Accepted>()[0].second.snapshot);
  EXPECT_EQ(sim.List().total, kLarge + 2u);
}

TEST(CoreFair, ALargeCommitOfASessionThatEndsIsAppliedFirst) {
  for (const bool taken_up : {false, true}) {
    Simulation sim;
    sim.Start();
    OpenOptions keep;
    keep.on_disconnect = DisconnectPolicy::kKeep;
    auto large = sim.Open(keep);
    auto second = OpenAgain(sim, large);
    BeginLarge(sim, large);
    Hand(second, 1, "b");
    if (taken_up) {
      OpenOptions resume;
      resume.resume_token = large.info.resume_token;
      auto next = sim.Open(resume);
      EXPECT_EQ(next.info.session, large.info.session);
      EXPECT_EQ(next.info.last_frame_id, 1u);
    } else {
      sim.Close(large);
    }
    EXPECT_EQ(sim.List().total, kLarge + 1u);
    EXPECT_EQ(CommitsAccepted(second), 1u);
  }
}

TEST(CoreFair, AnOwnerIsEvictedInTheMidstOfItsCommit) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open(), other = sim.Open();
  auto second = OpenAgain(sim, large);
  BeginLarge(sim, large);
  Hand(second, 1);
  Hand(other, 1, "b");
  OwnerControl control;
  control.owner = large.info.owner;
  control.evict = true;
  sim.core->ControlOwner(control, [](const absl::StatusOr<OwnerInfo>& info) {
    EXPECT_TRUE(info.ok()) << info.status();
  });
  sim.core->Step();
  EXPECT_TRUE(large.sink->ended.has_value());
  EXPECT_EQ(sim.List().total, 1u);
  EXPECT_EQ(CommitsAccepted(other), 1u);
}

TEST(CoreFair, WhatAnOperatorSetsMeanwhileHoldsForTheRest) {
  Simulation sim;
  sim.Start();
  auto large = sim.Open();
  BeginLarge(sim, large);
  OwnerControl control;
  control.owner = large.info.owner;
  control.max_entities = 10'000;
  control.hidden = true;
  sim.core->ControlOwner(control, [](const absl::StatusOr<OwnerInfo>&) {});
  sim.core->Step();
  const EntityPage page = sim.List();
  EXPECT_EQ(page.total, 10'000u);
  ASSERT_FALSE(large.sink->issues.empty());
  EXPECT_THAT(large.sink->issues[0].message, HasSubstr("what an operator has set for it is 10000"));
}

}  // namespace
}  // namespace voxeld::daemon
