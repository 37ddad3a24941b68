// Tests queries on the scene: pages, keys, statistics.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/daemon/fakes/simulation.h"

namespace voxeld::daemon {
namespace {

using testing::Dots;
using ::testing::ElementsAre;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::Put;
using testing::Simulation;

absl::StatusOr<EntityInfo> Get(Simulation& sim, EntityKey key) {
  absl::StatusOr<EntityInfo> result = absl::UnknownError("no answer");
  sim.core->GetEntity(std::move(key), [&](auto r) { result = std::move(r); });
  sim.core->Step();
  return result;
}

std::vector<std::string> Ids(const EntityPage& page) {
  std::vector<std::string> ids;
  for (const EntityInfo& entity : page.entities)
    ids.push_back(entity.key.layer + "/" + entity.key.id);
  return ids;
}

TEST(CoreQueries, AnEntityIsDescribed) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  EntityData data = Entity1(Dots(0, 0x123456, 7), testing::Shift(1));
  data.priority = 5;
  data.erase = true;
  data.label = "for people";
  sim.Send(client, 1, Put("a", "x", data), testing::Define("o", {{Dots(1), {}}}),
           testing::PutInstance("a", "y", "o"));
  const absl::StatusOr<EntityInfo> x = Get(sim, {client.info.owner, "a", "x"});
  ASSERT_TRUE(x.ok()) << x.status();
  EXPECT_EQ(x->kind, "points");
  EXPECT_EQ(x->vertices, 7u);
  EXPECT_GE(x->bytes, 84u);
  EXPECT_EQ(x->priority, 5u);
  EXPECT_TRUE(x->erase);
  EXPECT_EQ(x->transform, testing::Shift(1));
  EXPECT_EQ(x->sequence, 1u);
  EXPECT_EQ(x->expires_ns, 0);
  EXPECT_EQ(x->label, "for people");
  EXPECT_EQ(x->color, 0x123456u);
  EXPECT_EQ(Get(sim, {0, "a", "y"})->kind, "instance");
}

TEST(CoreQueries, AKeyWithoutAnOwnerMustNameOneEntity) {
  Simulation sim;
  sim.Start();
  auto one = sim.Open(), other = sim.Open();
  sim.Send(one, 1, Put("a", "x"), Put("a", "mine"));
  sim.Send(other, 2, Put("a", "x"));
  EXPECT_EQ(Get(sim, {0, "a", "mine"})->key.owner, one.info.owner);
  EXPECT_EQ(Get(sim, {0, "a", "x"}).status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Get(sim, {other.info.owner, "a", "x"})->key.owner, other.info.owner);
  const absl::Status missing = Get(sim, {other.info.owner, "a", "mine"}).status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(missing.message(), HasSubstr("\"mine\" in layer \"a\" of owner 2"));
}

TEST(CoreQueries, PagesAreStableWhateverChangesInBetween) {
  Simulation sim;
  sim.Start();
  auto one = sim.Open(), other = sim.Open();
  sim.Send(other, 1, Put("a", "z"));
  sim.Send(one, 2, Put("b", "p2"), Put("b", "p1"), Put("a", "q"), Put("c", ""), Put("b", "p3"));
  EntityQuery query;
  query.page_size = 2;
  EntityPage page = sim.List(query);
  EXPECT_THAT(Ids(page), ElementsAre("a/q", "b/p1"));
  EXPECT_EQ(page.total, 6u);
  EXPECT_EQ(page.layers.size(), 4u);
  ASSERT_FALSE(page.next_page_token.empty());
  query.page_token = page.next_page_token;
  // A listed entity is removed, and another is inserted before it: neither disturbs the rest.
  sim.Send(one, 3, testing::DeleteId("b", "p1"), Put("a", "a"));
  page = sim.List(query);
  EXPECT_THAT(Ids(page), ElementsAre("b/p2", "b/p3"));
  EXPECT_TRUE(page.layers.empty());
  query.page_token = page.next_page_token;
  page = sim.List(query);
  EXPECT_THAT(Ids(page), ElementsAre("c/", "a/z"));
  EXPECT_EQ(page.next_page_token, "");

  query = {};
  query.owner = one.info.owner;
  query.layer = "b";
  query.id_prefix = "p";
  query.page_size = 1;
  page = sim.List(query);
  EXPECT_THAT(Ids(page), ElementsAre("b/p2"));
  EXPECT_EQ(page.total, 2u);
  EXPECT_EQ(page.layers.size(), 1u);
  query.page_token = page.next_page_token;
  page = sim.List(query);
  EXPECT_THAT(Ids(page), ElementsAre("b/p3"));
  EXPECT_EQ(page.next_page_token, "");
}

TEST(CoreQueries, APageHoldsAThousandAtMost) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  std::vector<Operation> all;
  for (uint64_t i = 0; i < 2500; ++i) {
    all.push_back(Put("a", absl::StrCat(i)));
    all.back().sequence = i + 1;
  }
  all.push_back(testing::EndCommit(1));
  client.info.intake->Take({std::move(all), {}, 1});
  sim.core->Step();
  for (const uint32_t size : {0, 5000}) {
    EntityQuery query;
    query.page_size = size;
    size_t seen = 0;
    int pages = 0;
    do {
      const EntityPage page = sim.List(query);
      seen += page.entities.size();
      ++pages;
      query.page_token = page.next_page_token;
    } while (!query.page_token.empty());
    EXPECT_EQ(seen, 2500u);
    EXPECT_EQ(pages, 3);
  }
}

TEST(CoreQueries, ABadTokenIsRefused) {
  Simulation sim;
  sim.Start();
  for (const char* token : {"x", "1.2", "1.###.x", "a.b.c", "1.YQ.YQ.YQ"}) {
    EntityQuery query;
    query.page_token = token;
    absl::Status status;
    sim.core->ListEntities(query, [&](auto page) { status = page.status(); });
    sim.core->Step();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << token;
    EXPECT_THAT(status.message(), HasSubstr(token));
  }
}

TEST(CoreQueries, FiguresAddUp) {
  Simulation sim;
  sim.Start();
  auto client = sim.Open();
  sim.Send(client, 1, Put("a", "x"), Put("b", "y"), testing::Move("a", "nobody", {}));
  sim.clock.Advance(7 * sync::kMillisecond);
  sim.Show();
  sim.Send(client, 2);
  const Stats stats = sim.GetStats();
  EXPECT_EQ(stats.version, "test");
  EXPECT_EQ(stats.uptime_ns, 7 * sync::kMillisecond);
  EXPECT_EQ(stats.sessions, 1u);
  EXPECT_EQ(stats.owners, 1u);
  EXPECT_EQ(stats.layers, 2u);
  EXPECT_EQ(stats.entities, 2u);
  EXPECT_GT(stats.scene_bytes, 0u);
  EXPECT_EQ(stats.commits_accepted, 2u);
  EXPECT_EQ(stats.operations_applied, 2u);
  EXPECT_EQ(stats.operations_refused, 1u);
  EXPECT_EQ(stats.bytes_in, 200u);
  ASSERT_EQ(stats.displays.size(), 1u);
  const DisplayFigures& display = stats.displays[0];
  EXPECT_EQ(display.name, "main");
  EXPECT_EQ(display.state, display::DisplayState::kShowing);
  EXPECT_EQ(display.engine, "cpu");
  EXPECT_EQ(display.engine_device, "recording");
  EXPECT_EQ(display.lit_voxels, 2u);
  EXPECT_EQ(display.volumes_drawn, 2u);
  EXPECT_EQ(display.volumes_presented, 2u);
  EXPECT_EQ(display.volumes_per_second, 1.0);
  EXPECT_EQ(display.commit_to_presented.p50_ns, 7 * sync::kMillisecond);
  EXPECT_EQ(display.commit_to_last_byte.max_ns, 6 * sync::kMillisecond);
  EXPECT_EQ(display.commit_to_presented.count, 1u);
  EXPECT_EQ(display.assemble.p50_ns, 1000);
  EXPECT_EQ(display.slice.p99_ns, 2000);
  EXPECT_EQ(display.commits_owed, 2u);
  EXPECT_EQ(display.commits_presented, 1u);
  EXPECT_EQ(display.commits_unchanged, 1u);
}

// A simulation chooses which thread runs next: the core's thread is 0, the displays' follow.
TEST(CoreQueries, AQuestionGoesFromThreadToThreadInTheirTurns) {
  Simulation sim({}, 2);
  sim.Start();
  bool answered = false;
  sim.core->ListDisplays([&](const auto& displays) { answered = displays.ok(); });
  EXPECT_TRUE(sim.core->Ready(0));
  EXPECT_FALSE(sim.core->Ready(1));
  EXPECT_FALSE(sim.core->Ready(2));
  sim.core->Turn(0);
  EXPECT_FALSE(sim.core->Ready(0));
  EXPECT_TRUE(sim.core->Ready(1));
  sim.core->Turn(2);
  EXPECT_FALSE(sim.core->Ready(2));
  EXPECT_GT(sim.core->Turn(1), sim.clock.Now());
  EXPECT_FALSE(answered);
  EXPECT_TRUE(sim.core->Ready(0));
  sim.core->Turn(0);
  EXPECT_TRUE(answered);
  EXPECT_FALSE(sim.core->Ready(0));
}

}  // namespace
}  // namespace voxeld::daemon
