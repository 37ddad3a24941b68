// The changes that watchers receive, applied to plain maps, turn any snapshot into any other.
#include "daemon/scene/scene_changes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <utility>

#include "tests/daemon/scene/random_scene.h"

namespace voxeld::daemon {
namespace {

using testing::Define;
using testing::DeleteId;
using testing::Dots;
using testing::MakeAuthor;
using testing::Move;
using testing::Put;
using testing::Shift;
using testing::StoreFixture;

// The properties of a layer that are reported beside its entities.
struct LayerLook {
  uint64_t number = 0;
  bool visible = true;
  uint32_t opacity = 0;
  int32_t order = 0;
  gpu::BlendMode blend = gpu::BlendMode::kOver;
  gpu::Affine transform;
  Clip clip;
  std::optional<gpu::Region> region;
  std::string mask;
  std::string client_name;
  bool orphaned = false;
  bool operator==(const LayerLook&) const = default;
};

LayerLook LookOf(const Layer& layer) {
  return {layer.number,       layer.visible, layer.opacity, layer.order, layer.blend,
          layer.transform,    layer.clip,    layer.region,  layer.mask,  layer.writer->client_name,
          layer.writer->ended};
}

struct LayerModel {
  LayerLook look;
  std::map<std::string, const Entity*> entities;
  bool operator==(const LayerModel&) const = default;
};

// The state that a watcher knows. Every reported change must be new to it.
class Watcher final : public SceneChangeVisitor {
 public:
  bool OnObject(const OwnedName& key, const Object& object) override {
    EXPECT_TRUE(layers_told_ == 0) << "objects come first";
    const auto it = objects.find(key);
    EXPECT_TRUE(it == objects.end() || it->second != object.data.get()) << key.name;
    objects[key] = object.data.get();
    return Room();
  }
  bool OnRemovedObject(const OwnedName& key) override {
    EXPECT_EQ(objects.erase(key), 1u) << key.name;
    return Room();
  }
  bool OnLayer(const OwnedName& key, const Layer& layer) override {
    ++layers_told_;
    const auto it = layers.find(key);
    if (it != layers.end()) {
      EXPECT_EQ(it->second.look.number, layer.number);
      EXPECT_FALSE(it->second.look == LookOf(layer)) << "not a change of " << key.name;
    }
    layers[key].look = LookOf(layer);
    if (std::exchange(removed_, {}) == key) ++room_;  // the two are removed together
    return Room();
  }
  bool OnRemovedLayer(const OwnedName& key) override {
    EXPECT_EQ(layers.erase(key), 1u) << key.name;
    removed_ = key;
    return Room();
  }
  bool OnEntity(const OwnedName& layer, const std::string& id, const Entity& entity) override {
    const auto it = layers.find(layer);
    if (it == layers.end()) {
      ADD_FAILURE() << "an entity of the layer " << layer.name << ", which was not reported";
      return false;
    }
    const Entity*& held = it->second.entities[id];
    EXPECT_NE(held, &entity) << "not a change of " << id;
    held = &entity;
    return Room();
  }
  bool OnRemovedEntity(const OwnedName& layer, const std::string& id) override {
    EXPECT_TRUE(layers.contains(layer) && layers[layer].entities.erase(id) == 1) << id;
    return Room();
  }

  // Reports the changes from `before` to `after`, with room for up to `most` changes at a time.
  void Bring(const SceneFilter& filter, SnapshotPtr before, SnapshotPtr after, uint32_t most,
             std::mt19937& random) {
    SceneChanges changes(filter, std::move(before), std::move(after));
    layers_told_ = 0;
    calls = 0;
    changes_told = 0;
    do {
      room_ = 1 + random() % most;
      ++calls;
    } while (!changes.Next(*this));
    EXPECT_TRUE(changes.Next(*this));
  }

  std::map<OwnedName, LayerModel> layers;
  std::map<OwnedName, const ObjectData*> objects;
  int calls = 0;
  int changes_told = 0;

 private:
  bool Room() {
    ++changes_told;
    EXPECT_GT(room_, 0u) << "reported without room";
    if (room_ > 0) --room_;
    return room_ > 0;
  }

  uint32_t room_ = 0;
  OwnedName removed_;
  int layers_told_ = 0;
};

bool Matches(const SceneFilter& filter, const OwnedName& key) {
  return (filter.owner == 0 || key.owner == filter.owner) &&
         (filter.layer.empty() || key.name == filter.layer);
}

std::map<OwnedName, LayerModel> LayersOf(const Snapshot& scene, const SceneFilter& filter) {
  std::map<OwnedName, LayerModel> layers;
  scene.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if (!Matches(filter, key)) return;
    LayerModel& model = layers[key];
    model.look = LookOf(*layer);
    layer->entities.ForEach(
        [&](const std::string& id, const EntityPtr& entity) { model.entities[id] = entity.get(); });
  });
  return layers;
}

std::map<OwnedName, const ObjectData*> ObjectsOf(const Snapshot& scene, const SceneFilter& filter) {
  std::map<OwnedName, const ObjectData*> objects;
  scene.objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    if (!filter.objects || (filter.owner != 0 && key.owner != filter.owner)) return;
    objects[key] = object->data.get();
  });
  return objects;
}

// Several watchers with filters, each of which looks at random times, and a scene of three owners.
TEST(SceneChanges, AnyWatcherComesToAnySnapshot) {
  for (uint32_t seed = 1; seed <= 250; ++seed) {
    std::mt19937 random(seed);
    StoreFixture f;
    const std::vector<Author> authors = {MakeAuthor(1, 11), MakeAuthor(2, 12), MakeAuthor(3, 13),
                                         MakeAuthor(2, 14)};
    struct Watch {
      SceneFilter filter;
      Watcher watcher;
      SnapshotPtr told;
    };
    std::vector<Watch> watches(5);
    for (Watch& watch : watches) {
      if (random() % 3 == 0) watch.filter.owner = 1 + random() % 4;
      if (random() % 3 == 0) watch.filter.layer = absl::StrCat("l", random() % 5);
      watch.filter.objects = random() % 2 == 0;
    }
    std::vector<SnapshotPtr> all = {f.store.snapshot()};
    for (int step = 0; step < 40; ++step) {
      const uint32_t what = random() % 12;
      if (what == 0) {
        const uint64_t owner = 1 + random() % 3;
        f.store.RemoveLayers([&](const OwnedName& key, const Layer&) { return key.owner == owner; },
                             random() % 3 == 0);
      } else if (what == 1) {
        f.Orphan(11 + random() % 4);
      } else if (what == 2) {
        f.now += random() % 10;
        f.store.Expire(f.now);
      } else {
        std::vector<Operation> operations = testing::RandomOperations(random, 10);
        for (Operation& operation : operations) operation.sequence = ++f.last_sequence;
        f.CommitAll(authors[random() % authors.size()], std::move(operations));
      }
      all.push_back(f.store.snapshot());
      for (Watch& watch : watches) {
        if (random() % 3 != 0) continue;
        // Mostly the newest snapshot; at times any, also an older one.
        SnapshotPtr next = random() % 4 == 0 ? all[random() % all.size()] : all.back();
        watch.watcher.Bring(watch.filter, watch.told, next, 1 + random() % 6, random);
        watch.told = next;
        ASSERT_EQ(watch.watcher.layers, LayersOf(*next, watch.filter)) << "seed " << seed;
        ASSERT_EQ(watch.watcher.objects, ObjectsOf(*next, watch.filter)) << "seed " << seed;
      }
    }
  }
}

TEST(SceneChanges, ALayerMadeAgainIsRemovedFirst) {
  StoreFixture f;
  f.Commit(Put("a", "x", 1), Put("a", "y", 2), Put("b", "z", 3));
  const SnapshotPtr before = f.store.snapshot();
  f.store.RemoveLayers([](const OwnedName& key, const Layer&) { return key.name == "a"; }, false);
  f.Commit(Put("a", "x", 1));
  std::mt19937 random(1);
  Watcher watcher;
  watcher.Bring({}, nullptr, before, 100, random);
  EXPECT_EQ(watcher.changes_told, 5);
  watcher.Bring({}, before, f.store.snapshot(), 1, random);
  EXPECT_EQ(watcher.changes_told, 3);  // removed, made, its entity
  EXPECT_EQ(watcher.layers, LayersOf(*f.store.snapshot(), {}));
}

TEST(SceneChanges, AClipAndARegionAreNews) {
  StoreFixture f;
  f.Commit(Put("a", "x", 1));
  std::mt19937 random(1);
  Watcher watcher;
  watcher.Bring({}, nullptr, f.store.snapshot(), 100, random);
  const auto tells = [&](Operation operation) {
    const SnapshotPtr before = f.store.snapshot();
    f.Commit(std::move(operation));
    watcher.Bring({}, before, f.store.snapshot(), 100, random);
    EXPECT_EQ(watcher.changes_told, 1);
    EXPECT_EQ(watcher.layers, LayersOf(*f.store.snapshot(), {}));
  };
  tells(testing::SetClip("a", {{1, 0, 0, 2}}));
  tells(testing::SetClip("a", {{1, 0, 0, 3}}));
  tells(testing::SetRegion("a", gpu::Region{{0, 0, 0}, {1, 1, 1}}));
  tells(testing::SetRegion("a", std::nullopt));
  tells(testing::SetClip("a", {}));
}

TEST(SceneChanges, CountsAreNoNewsButOrphansAre) {
  StoreFixture f;
  f.Commit(Put("a", "x", 1), Put("a", "y", 2));
  const SnapshotPtr before = f.store.snapshot();
  f.Commit(DeleteId("a", "x"));
  std::mt19937 random(1);
  Watcher watcher;
  watcher.Bring({}, nullptr, before, 100, random);
  watcher.Bring({}, before, f.store.snapshot(), 100, random);
  EXPECT_EQ(watcher.changes_told, 1);  // the entity
  const SnapshotPtr deleted = f.store.snapshot();
  f.Orphan(11);
  watcher.Bring({}, deleted, f.store.snapshot(), 100, random);
  EXPECT_EQ(watcher.changes_told, 1);
  EXPECT_TRUE((watcher.layers[{1, "a"}].look.orphaned));
  const SnapshotPtr orphaned = f.store.snapshot();
  f.Orphan(11);
  EXPECT_EQ(f.store.snapshot(), orphaned);
  // The session that writes it next becomes its owner.
  f.Commit(MakeAuthor(1, 12), Move("a", "y", Shift(3)));
  watcher.Bring({}, orphaned, f.store.snapshot(), 100, random);
  EXPECT_EQ(watcher.changes_told, 2);
  EXPECT_FALSE((watcher.layers[{1, "a"}].look.orphaned));
}

// An object is inserted again when one that it refers to changes; its own definition is the same.
TEST(SceneChanges, AnObjectIsNewsByItsOwnDefinitionOnly) {
  StoreFixture f;
  f.Commit(Define("leaf", {{Dots(1), {}}}), Define("tree", {{InstanceRef{"leaf"}, {}}}));
  const SnapshotPtr before = f.store.snapshot();
  f.Commit(Define("leaf", {{Dots(2), {}}, {Dots(3), {}}}));
  std::mt19937 random(1);
  Watcher watcher;
  watcher.Bring({.objects = true}, nullptr, before, 1, random);
  EXPECT_EQ(watcher.changes_told, 2);
  EXPECT_EQ(watcher.calls, 3);
  watcher.Bring({.objects = true}, before, f.store.snapshot(), 1, random);
  EXPECT_EQ(watcher.changes_told, 1);
  watcher.Bring({}, before, f.store.snapshot(), 1, random);
  EXPECT_EQ(watcher.changes_told, 0);
}

// ------------------------------------------------------------------ how large changes are, by owner

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

class ChangeSizes : public ::testing::Test {
 protected:
  ChangeSizes() {
    f_.Commit(Put("a", "x", 1), Put("a", "y", 2), Put("a", "z", 3));
    f_.Commit(other_, Put("a", "x", 1));
    before_ = f_.store.snapshot();
  }
  std::map<uint64_t, uint64_t> Changes(uint64_t most = 1000) {
    return ChangesByOwner(*before_, *f_.store.snapshot(), most);
  }

  StoreFixture f_;
  const Author other_ = MakeAuthor(2, 12);
  SnapshotPtr before_;
};

TEST_F(ChangeSizes, EachEntityThatIsPutMovedOrRemovedCounts) {
  EXPECT_THAT(Changes(), IsEmpty());
  f_.Commit(Put("a", "new", 1), Move("a", "x", Shift(1)), DeleteId("a", "y"));
  EXPECT_THAT(Changes(), ElementsAre(Pair(1, 3)));
  f_.Commit(other_, Put("b", "x", 1), Put("b", "y", 1));
  EXPECT_THAT(Changes(), ElementsAre(Pair(1, 3), Pair(2, 2)));
  EXPECT_THAT(ChangesByOwner(*before_, *f_.store.snapshot(), 1000, {1}), ElementsAre(Pair(2, 2)));
}

TEST_F(ChangeSizes, CountingStopsWhereItIsLarge) {
  for (int i = 0; i < 100; ++i) f_.Commit(Put("a", std::to_string(i), 1));
  EXPECT_THAT(Changes(10), ElementsAre(Pair(1, 10)));
}

TEST_F(ChangeSizes, ALayerThatMovesComesOrGoesCountsWithAllThatItHolds) {
  f_.Commit(testing::SetLayer("a", std::nullopt, Shift(1)));
  EXPECT_THAT(Changes(), ElementsAre(Pair(1, 3)));
  f_.Commit(testing::SetLayer("a", false));
  f_.Commit(testing::DeleteAllOf("a"));
  EXPECT_THAT(Changes(), ElementsAre(Pair(1, 3)));
  EXPECT_THAT(ChangesByOwner(*f_.store.snapshot(), *before_, 1000), ElementsAre(Pair(1, 3)));
}

TEST_F(ChangeSizes, AnEntityCountsByItsBytesAndAnInstanceByWhatItDraws) {
  f_.Commit(Put("a", "large", testing::Entity1(Dots(0, 1, 10'000))));
  EXPECT_GE(Changes()[1], 10'000u * 12 / 4096);
  before_ = f_.store.snapshot();
  f_.Commit(Define("o", {{Dots(1), {}}, {Dots(2), {}}}));
  EXPECT_EQ(Changes()[1], 0u);
  f_.Commit(testing::PutInstance("a", "i", "o"), testing::PutInstance("a", "j", "o"));
  EXPECT_EQ(Changes()[1], 4u);
  before_ = f_.store.snapshot();
  f_.Commit(Define("o", {{Dots(1), {}}, {Dots(2), {}}, {Dots(3), {}}}));
  EXPECT_EQ(Changes()[1], 6u) << "both are drawn anew";
}

TEST_F(ChangeSizes, AnOwnerIsHiddenAtOnceWhateverPartIsDrawn) {
  f_.Commit(Put("a", "new", 1));
  f_.store.Suppress(1, true);
  const SnapshotPtr hidden = WithPartsOf(*f_.store.snapshot(), *before_, {1});
  EXPECT_FALSE(hidden->FindLayer({1, "a"})->shown());
  EXPECT_EQ(hidden->FindEntity({1, "a"}, "new"), nullptr);
  EXPECT_EQ(Changes()[1], 1u) << "hiding is not part of what is held back";
  EXPECT_TRUE(before_->FindLayer({1, "a"})->shown());
}

TEST_F(ChangeSizes, PartsOfAnotherSnapshotAreThoseOfTheOwnersAlone) {
  f_.Commit(Define("o", {{Dots(1), {}}}), DeleteId("a", "x"), Put("b", "new", 1));
  f_.Commit(other_, Put("a", "x", 9), Put("b", "y", 1));
  const Snapshot& now = *f_.store.snapshot();
  const SnapshotPtr joined = WithPartsOf(now, *before_, {1});
  EXPECT_EQ(joined->number, now.number);
  EXPECT_EQ(joined->FindLayer({1, "a"}), before_->FindLayer({1, "a"}));
  EXPECT_EQ(joined->FindLayer({1, "b"}), nullptr);
  EXPECT_EQ(joined->FindObject({1, "o"}), nullptr);
  EXPECT_EQ(joined->FindLayer({2, "a"}), now.FindLayer({2, "a"}));
  EXPECT_EQ(joined->FindLayer({2, "b"}), now.FindLayer({2, "b"}));
  EXPECT_EQ(joined->layers.size(), 3u);
  EXPECT_EQ(*joined->owners.Find(1), *before_->owners.Find(1));
  EXPECT_EQ(*joined->owners.Find(2), *now.owners.Find(2));
  OwnerTally total = *joined->owners.Find(1);
  total.drawables += joined->owners.Find(2)->drawables;
  total.layers += joined->owners.Find(2)->layers;
  total.bytes += joined->owners.Find(2)->bytes;
  total.derived += joined->owners.Find(2)->derived;
  EXPECT_EQ(joined->total, total);
  EXPECT_EQ(WithPartsOf(now, Snapshot(), {1, 2})->total, OwnerTally());
}

}  // namespace
}  // namespace voxeld::daemon
