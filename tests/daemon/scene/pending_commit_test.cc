// Tests commits that are applied in slices, while other owners' commits are applied.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/scene/scene_store.h"
#include "tests/daemon/scene/random_scene.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace {

using testing::Begin;
using testing::CheckIndices;
using testing::Define;
using testing::DeleteAllOf;
using testing::Dots;
using testing::End;
using testing::Entity1;
using ::testing::HasSubstr;
using testing::MakeAuthor;
using testing::Put;
using testing::PutInstance;
using testing::Scale;
using testing::Sequence;
using testing::SetLayer;
using testing::StoreFixture;

using Pending = std::unique_ptr<SceneStore::PendingCommit>;

// Begins a commit of the fixture's author.
template <typename... Ops>
Pending Start(StoreFixture& f, Ops... ops) {
  std::vector<Operation> all = Sequence(f.last_sequence, std::move(ops)...);
  f.last_sequence += all.size();
  return f.store.Begin(f.me, std::move(all), f.now);
}

// Returns the whole scene without numbers, in which another order of commits may differ.
std::string Everything(const Snapshot& snapshot) {
  std::string text;
  snapshot.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    absl::StrAppend(&text, key.owner, "/", key.name, " shown ", layer->shown(), " writer ",
                    layer->writer->session, layer->writer->ended ? " ended" : "", " bytes ",
                    layer->bytes, "\n");
    layer->entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      absl::StrAppend(&text, "  ", id, " sequence ", entity->sequence, " at ",
                      entity->data.transform.m[3], " until ", entity->expires_ns, " content ",
                      entity->data.content.index(), " priority ", entity->data.priority, "\n");
    });
  });
  snapshot.objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    absl::StrAppend(&text, "object ", key.owner, "/", key.name, " parts ",
                    object->data->parts.size(), " drawables ", object->drawables, "\n");
  });
  return text;
}

TEST(PendingCommit, IsNotSeenUntilItIsFinishedAndOthersCommitMeanwhile) {
  StoreFixture f;
  const Author other = MakeAuthor(2, 22);
  Pending pending = Start(f, Put("a", "x"), Put("a", "y"), Put("a", "z"));
  EXPECT_FALSE(f.store.Continue(*pending, 2));
  EXPECT_EQ(f.Scene(), "");
  EXPECT_TRUE(f.Commit(other, Put("b", "1"), Put("b", "2")).applied);
  EXPECT_EQ(f.Scene(), "b: 1 2");
  EXPECT_FALSE(f.store.Continue(*pending, 1));
  EXPECT_TRUE(f.store.Continue(*pending, 1));
  EXPECT_TRUE(f.Commit(other, DeleteAllOf("b"), Put("c", "3")).applied);
  const CommitResult result = f.store.Finish(std::move(pending));
  EXPECT_TRUE(result.applied);
  EXPECT_EQ(result.applied_operations, 3u);
  EXPECT_EQ(f.Scene(), "a: x y z; b:; c: 3");
  EXPECT_EQ(f.store.snapshot()->number, 4u);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(PendingCommit, OneThatIsGivenUpWasNeverThere) {
  StoreFixture f;
  f.Commit(Put("a", "x"));
  Pending pending = Start(f, DeleteAllOf("a"), Put("a", "y"));
  EXPECT_FALSE(f.store.Continue(*pending, 1));
  pending.reset();
  EXPECT_EQ(f.Scene(), "a: x");
  EXPECT_TRUE(f.Commit(Put("a", "z")).applied);
  EXPECT_EQ(f.Scene(), "a: x z");
}

TEST(PendingCommit, AFrameTakesEffectInSlicesToo) {
  StoreFixture f;
  f.Commit(Put("a", "old"), Put("a", "x"));
  const uint64_t number = f.Get("a", "x")->number;
  Pending pending = Start(f, Begin("a"), Put("a", "x"), Put("a", "y"), End("a"));
  int slices = 1;
  while (!f.store.Continue(*pending, 1)) ++slices;
  EXPECT_EQ(
      slices,
      8);  // four operations, two of which are replayed, the frame's end, and the step that finds
           // that everything is done
  const CommitResult result = f.store.Finish(std::move(pending));
  EXPECT_EQ(result.applied_operations, 4u);
  EXPECT_EQ(f.Scene(), "a: x y");
  EXPECT_EQ(f.Get("a", "x")->number, number);
}

TEST(PendingCommit, AGroupCountsAsWhatItHas) {
  StoreFixture f;
  auto group = std::make_shared<GroupData>();
  group->parts.resize(100, GroupData::Part{Dots(0), {}});
  Pending pending = Start(f, Put("a", "x", Entity1(GroupPtr(group))), Put("a", "y"));
  EXPECT_FALSE(f.store.Continue(*pending, 100));
  EXPECT_FALSE(f.store.Continue(*pending, 1));
  EXPECT_TRUE(f.store.Continue(*pending, 1));
}

TEST(PendingCommit, AGroupInAFrameCountsAsWhatItHas) {
  StoreFixture f;
  auto group = std::make_shared<GroupData>();
  group->parts.resize(100, GroupData::Part{Dots(0), {}});
  Pending pending =
      Start(f, Begin("a"), Put("a", "x", Entity1(GroupPtr(group))), Put("a", "y"), End("a"));
  EXPECT_FALSE(f.store.Continue(*pending, 103));  // to the end of the frame
  EXPECT_FALSE(f.store.Continue(*pending, 50));   // the group takes effect
  EXPECT_FALSE(f.store.Continue(*pending, 2));    // the other entity and the end
  EXPECT_TRUE(f.store.Continue(*pending, 1));
}

TEST(PendingCommit, WhatExpiresMeanwhileGoesUnlessItWasReplaced) {
  StoreFixture f;
  const auto brief = [] {
    EntityData data = Entity1(Dots(1));
    data.lifetime_ns = 10;
    return data;
  };
  f.Commit(Put("a", "goes", brief()), Put("a", "stays", brief()), Put("b", "goes", brief()));
  Pending pending = Start(f, Put("a", "stays"), Put("a", "new"));
  EXPECT_FALSE(f.store.Continue(*pending, 2));
  EXPECT_TRUE(f.store.Expire(f.now + 10));
  EXPECT_EQ(f.Scene(), "a:; b:");
  EXPECT_TRUE(f.store.Continue(*pending, 1));
  f.store.Finish(std::move(pending));
  EXPECT_EQ(f.Scene(), "a: new stays; b:");
  EXPECT_EQ(f.store.next_expiry(), sync::kNever);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(PendingCommit, LayersThatAreClearedMeanwhileKeepOnlyWhatItBrings) {
  for (const bool keep_state : {false, true}) {
    StoreFixture f;
    f.Commit(Put("a", "old"), Put("b", "old"), Put("c", "old"));
    Pending pending = Start(f, Put("a", "new"), SetLayer("c", false));
    EXPECT_FALSE(f.store.Continue(*pending, 2));
    EXPECT_EQ(f.store.RemoveLayers([](const OwnedName&, const Layer&) { return true; }, keep_state)
                  .entities,
              3u);
    EXPECT_TRUE(f.store.Continue(*pending, 1));
    f.store.Finish(std::move(pending));
    EXPECT_EQ(f.Scene(), keep_state ? "a: new; b:; c:" : "a: new; c:");
    EXPECT_FALSE(f.GetLayer("c")->visible);
    EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
  }
}

TEST(PendingCommit, AnOwnerThatIsHiddenMeanwhileIsHiddenWhole) {
  StoreFixture f;
  f.Commit(Put("a", "x"), Put("b", "x"));
  Pending pending = Start(f, Put("a", "y"), Put("new", "y"));
  EXPECT_FALSE(f.store.Continue(*pending, 2));
  f.store.Suppress(1, true);
  SceneStore::SetQuotas(*pending, true, UINT64_MAX, UINT64_MAX);
  EXPECT_TRUE(f.store.Continue(*pending, 1));
  f.store.Finish(std::move(pending));
  for (const char* layer : {"a", "b", "new"}) EXPECT_FALSE(f.GetLayer(layer)->shown()) << layer;
}

TEST(PendingCommit, LayersThatItDoesNotChangeGetTheirNewWriter) {
  StoreFixture f;
  const Author second = MakeAuthor(1, 12);  // another session of the same owner
  f.Commit(second, Put("theirs", "x"), Put("both", "x"));
  Pending pending = Start(f, Put("mine", "x"), Put("both", "y"));
  EXPECT_FALSE(f.store.Continue(*pending, 2));
  f.Orphan(12);
  EXPECT_TRUE(f.store.Continue(*pending, 1));
  f.store.Finish(std::move(pending));
  EXPECT_TRUE(f.GetLayer("theirs")->writer->ended);
  EXPECT_EQ(f.GetLayer("both")->writer->session, 11u);
  EXPECT_FALSE(f.GetLayer("both")->writer->ended);
}

TEST(PendingCommit, WhatItBringsCountsAgainstWhatAllOwnersShare) {
  Limits limits;
  limits.max_entities = 4;
  StoreFixture f(limits);
  const Author other = MakeAuthor(2, 22);
  Pending pending = Start(f, Put("a", "1"), Put("a", "2"), Put("a", "3"));
  EXPECT_FALSE(f.store.Continue(*pending, 3));
  const CommitResult refused = f.Commit(other, Put("b", "1"), Put("b", "2"));
  EXPECT_EQ(refused.refused_operations, 1u);
  EXPECT_THAT(refused.issues.at(0).message, HasSubstr("max_entities"));
  f.store.Finish(std::move(pending));
  EXPECT_EQ(f.store.snapshot()->total.drawables, 4u);

  // The same holds for memory.
  const EntityData large = Entity1(Dots(0, 1, 8000));
  StoreFixture alone, g;
  alone.Commit(Put("a", "x", large));
  const OwnerTally& one = alone.store.snapshot()->total;
  g.store.SetMemoryRoom({.bytes = (one.bytes + one.derived) * 3 / 2, .engines = 1});
  Pending first = g.store.Begin(g.me, {Put("a", "x", large)}, g.now);
  EXPECT_TRUE(g.store.Continue(*first, 10));
  const CommitResult second = g.Commit(other, Put("b", "x", large));
  ASSERT_EQ(second.refused_operations, 1u);
  EXPECT_THAT(second.issues[0].message, HasSubstr("max_memory_bytes"));
  first.reset();
  EXPECT_EQ(g.Commit(other, Put("b", "x", large)).refused_operations, 0u);
}

TEST(PendingCommit, ANewViewMustFitWhatItHasBroughtSoFar) {
  Limits limits;
  limits.max_coordinate_voxels = 100;
  StoreFixture f(limits);
  f.store.SetViews({{"disp", {}}});
  Pending pending = Start(f, Put("a", "far", 60));
  EXPECT_TRUE(f.store.CheckNewView({"disp", Scale(2, 1, 1)}).ok());
  EXPECT_TRUE(f.store.Continue(*pending, 10));
  EXPECT_THAT(std::string(f.store.CheckNewView({"disp", Scale(2, 1, 1)}).message()),
              HasSubstr("120 voxels"));
  pending.reset();
  EXPECT_TRUE(f.store.CheckNewView({"disp", Scale(2, 1, 1)}).ok());

  // Entities that others have removed since the last slice does not count.
  const Author other = MakeAuthor(2, 22);
  f.Commit(other, Put("b", "far", 60));
  pending = Start(f, Put("a", "near", 1));
  EXPECT_TRUE(f.store.Continue(*pending, 10));
  EXPECT_FALSE(f.store.CheckNewView({"disp", Scale(2, 1, 1)}).ok());
  f.Commit(other, DeleteAllOf("b"));
  EXPECT_TRUE(f.store.CheckNewView({"disp", Scale(2, 1, 1)}).ok());
}

// Random commits of several owners in random slices result in the scene that the same commits,
// applied whole, result in, in the order in which they were finished.
TEST(PendingCommit, SlicesMakeWhatWholeCommitsMake) {
  uint64_t overlapping = 0;
  for (uint32_t seed = 1; seed <= 300; ++seed) {
    std::mt19937 random(seed);
    struct Client {
      Author author;
      Pending pending;
      std::vector<Operation> operations;  // its operations, for the other store
      uint64_t sequence = 0;
      bool strict = false;
    };
    StoreFixture sliced, whole;
    std::vector<Client> clients(3);
    for (size_t i = 0; i < clients.size(); ++i) clients[i].author = MakeAuthor(i + 1, 10 * i + 11);
    sync::TimeNs now = sync::kSecond;
    for (int step = 0; step < 120; ++step) {
      Client& client = clients[random() % clients.size()];
      if (client.pending == nullptr) {
        std::vector<Operation> operations;
        for (Operation& operation : testing::RandomOperations(random, 20)) {
          operation.sequence = ++client.sequence;
          // Lifetimes count from the beginning; their effect on a commit under way is tested above.
          if (auto* upsert = std::get_if<Upsert>(&operation.op)) upsert->entity.lifetime_ns = 0;
          operations.push_back(std::move(operation));
        }
        client.operations = operations;
        client.strict = random() % 4 == 0;
        client.pending =
            sliced.store.Begin(client.author, std::move(operations), now, client.strict);
      } else if (sliced.store.Continue(*client.pending, 1 + random() % 8)) {
        const CommitResult a = sliced.store.Finish(std::move(client.pending));
        const CommitResult b =
            whole.store.Apply(client.author, client.operations, now, client.strict);
        ASSERT_EQ(a.applied, b.applied) << "seed " << seed;
        ASSERT_EQ(a.applied_operations, b.applied_operations) << "seed " << seed;
        ASSERT_EQ(a.refused_operations, b.refused_operations) << "seed " << seed;
        ASSERT_EQ(a.hidden, b.hidden) << "seed " << seed;
        ASSERT_EQ(Everything(*sliced.store.snapshot()), Everything(*whole.store.snapshot()))
            << "seed " << seed;
        ASSERT_EQ(CheckIndices(*sliced.store.snapshot()), "") << "seed " << seed;
        ASSERT_EQ(sliced.store.snapshot()->number, whole.store.snapshot()->number);
        for (const Client& other : clients) overlapping += other.pending != nullptr ? 1 : 0;
      }
    }
  }
  EXPECT_GT(overlapping, 1000u);
}

}  // namespace
}  // namespace voxeld::daemon
