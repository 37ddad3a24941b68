// Tests deltas between any two snapshots, checked by an engine's model of the scene.
#include "daemon/scene/engine_delta.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include "tests/daemon/fakes/recording_engine.h"
#include "tests/daemon/scene/random_scene.h"

namespace voxeld::daemon {
namespace {

using testing::Define;
using testing::DeleteId;
using testing::Dots;
using testing::Entity1;
using testing::Move;
using testing::Put;
using testing::PutInstance;
using testing::SceneModel;
using testing::SetLayer;
using testing::Shift;
using testing::StoreFixture;
using testing::Undefine;

// An EngineScene and the engine that receives its deltas.
struct Pair {
  EngineScene scene;
  SceneModel model;
  size_t size = 0;

  absl::Status Bring(const SnapshotPtr& snapshot) {
    size = scene.Plan(snapshot);
    std::vector<uint64_t> words((size + 15) / 8 + 2);
    // 16-byte aligned, as staging memory is.
    std::byte* bytes = reinterpret_cast<std::byte*>(words.data());
    if (reinterpret_cast<uintptr_t>(bytes) % 16 != 0) bytes += 8;
    gpu::DeltaWriter writer(std::span(bytes, size));
    scene.Write(writer);
    EXPECT_FALSE(writer.overrun());
    EXPECT_EQ(writer.size(), size);
    const std::vector<gpu::BulkBlock> referred = writer.TakeReferred();
    return model.Apply(std::span(bytes, size), referred);
  }
};

TEST(EngineDelta, PutsWhatIsNewAndDropsWhatIsGone) {
  StoreFixture f;
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.size, gpu::DeltaWriter::kSizeOfReset);  // an engine in an unknown state
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.size, 0u);

  f.Commit(Put("a", "x", 1), Put("a", "y", 2));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.puts(), 5);  // a layer, two geometries, two drawables
  EXPECT_EQ(pair.model.layers().begin()->first, f.GetLayer("a")->number);

  f.Commit(Move("a", "x", Shift(4)));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.puts(), 1);  // the geometry exists already
  EXPECT_EQ(pair.model.drops(), 0);
  EXPECT_EQ(pair.size, gpu::DeltaWriter::SizeOf(gpu::DrawableRecord()));

  f.Commit(Put("a", "x", 3));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.puts(), 2);
  EXPECT_EQ(pair.model.drops(), 1);  // the old geometry; the drawable is replaced
  EXPECT_EQ(pair.model.drawables().size(), 2u);

  f.Commit(SetLayer("a", false));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.puts(), 1);

  f.Commit(DeleteId("a", "x"));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.puts(), 0);
  EXPECT_EQ(pair.model.drops(), 2);

  f.Commit(testing::DeleteAllMine());
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_TRUE(pair.model.layers().empty() && pair.model.geometries().empty());
  EXPECT_EQ(pair.scene.geometries(), 0u);
}

TEST(EngineDelta, WhatAnEngineDoesNotSeeIsNotSent) {
  StoreFixture f;
  const GeometryPtr dots = Dots(1);
  EntityData data = Entity1(dots);
  f.Commit(Put("a", "x", data));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  data.label = "another";
  data.lifetime_ns = 1000;
  f.Commit(Put("a", "x", data), Define("unused", {{Dots(1), {}}}));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.size, 0u);
}

TEST(EngineDelta, ALayersClipAndRegionGoWithTheLayerAlone) {
  StoreFixture f;
  f.Commit(Put("a", "x"), Put("b", "y"));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  const gpu::ClipPlane floor{0, 0, 1, 0}, wall{1, 0, 0, -2};
  const gpu::Region box{{0, 0, 0}, {1, 2, 3}};
  const auto layer = [&] { return pair.model.layers().at(f.GetLayer("a")->number); };
  const auto bring = [&](Operation operation) {
    f.Commit(std::move(operation));
    EXPECT_TRUE(pair.Bring(f.store.snapshot()).ok());
    return pair.model.puts() + pair.model.drops();
  };
  EXPECT_EQ(bring(testing::SetClip("a", {floor, wall})), 1);
  EXPECT_EQ(layer().plane_count, 2u);
  EXPECT_EQ(layer().planes[0], floor);
  EXPECT_EQ(layer().planes[1], wall);
  EXPECT_EQ(layer().has_region, 0u);
  EXPECT_EQ(bring(testing::SetRegion("a", box)), 1);
  EXPECT_EQ(layer().plane_count, 2u);
  EXPECT_EQ(layer().has_region, 1u);
  EXPECT_EQ(layer().region, box);
  f.Commit(testing::SetClip("a", {floor, wall}), testing::SetRegion("a", box));
  EXPECT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.size, 0u);  // the same again
  EXPECT_EQ(bring(testing::SetClip("a", {})), 1);
  EXPECT_EQ(layer().plane_count, 0u);
  EXPECT_EQ(bring(testing::SetRegion("a", std::nullopt)), 1);
  EXPECT_EQ(layer().has_region, 0u);
}

TEST(EngineDelta, AMaskIsTheLayerOfThatName) {
  StoreFixture f;
  f.Commit(Put("a", "x"), Put("b", "y"), testing::SetMask("a", "b"));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  const auto layer = [&] { return pair.model.layers().at(f.GetLayer("a")->number); };
  const auto bring = [&](auto... operations) {
    f.Commit(std::move(operations)...);
    EXPECT_TRUE(pair.Bring(f.store.snapshot()).ok());
    return pair.model.puts() + pair.model.drops();
  };
  EXPECT_EQ(layer().has_mask, 1u);
  EXPECT_EQ(layer().mask, f.GetLayer("b")->number);
  EXPECT_EQ(bring(testing::SetMask("a", "b")), 0);  // the same again
  // A layer that does not exist has no number.
  EXPECT_EQ(bring(testing::SetMask("a", "c")), 1);
  EXPECT_EQ(layer().has_mask, 1u);
  EXPECT_EQ(layer().mask, 0u);
  // When it is created, and when it is removed, the layer that it masks is updated.
  const SnapshotPtr without = f.store.snapshot();
  EXPECT_EQ(bring(Put("c", "z")), 4);  // layer, geometry, drawable; and a
  EXPECT_EQ(layer().mask, f.GetLayer("c")->number);
  const SnapshotPtr with = f.store.snapshot();
  EXPECT_TRUE(pair.Bring(without).ok());
  EXPECT_EQ(layer().mask, 0u);
  EXPECT_TRUE(pair.Bring(with).ok());
  EXPECT_EQ(layer().mask, f.GetLayer("c")->number);
  EXPECT_EQ(bring(testing::SetMask("a", "")), 1);
  EXPECT_EQ(layer().has_mask, 0u);
}

TEST(EngineDelta, AMaskIsOfTheSameOwner) {
  StoreFixture f;
  f.Commit(Put("a", "x"), testing::SetMask("a", "b"));
  f.Commit(testing::MakeAuthor(2, 12), Put("b", "y"));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.layers().at(f.GetLayer("a")->number).mask, 0u);
}

TEST(EngineDelta, InstancesShareGeometriesAndComposeFromTheOutside) {
  StoreFixture f;
  gpu::Affine turn;  // a quarter turn about z
  turn.m[0] = 0;
  turn.m[1] = -1;
  turn.m[4] = 1;
  turn.m[5] = 0;
  f.Commit(Define("pair", {{Dots(1), Shift(1)}, {Dots(2), Shift(2)}}),
           Define("turned", {{InstanceRef{"pair"}, turn}}),
           PutInstance("a", "x", "turned", Shift(0, 0, 9)), PutInstance("b", "y", "pair"));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.geometries().size(), 2u);
  ASSERT_EQ(pair.model.drawables().size(), 4u);
  int found = 0;
  for (const auto& [id, drawable] : pair.model.drawables()) {
    if (drawable.layer != f.GetLayer("a")->number) continue;
    const double x = pair.model.geometries().at(drawable.geometry).positions[0];
    const gpu::Affine want = gpu::Compose(gpu::Compose(Shift(0, 0, 9), turn), Shift(x));
    EXPECT_EQ(drawable.transform, want);
    ++found;
  }
  EXPECT_EQ(found, 2);

  // A changed definition changes every instance, including nested ones, and nothing else.
  f.Commit(Define("pair", {{Dots(5), Shift(1)}}), Put("c", "z"));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.geometries().size(), 2u);  // one of the object's, one of z
  EXPECT_EQ(pair.model.drawables().size(), 3u);
  f.Commit(Undefine("pair", true));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.drawables().size(), 1u);
}

TEST(EngineDelta, AnUnchangedPartsGeometryIsNotSentAgain) {
  StoreFixture f;
  const GeometryPtr kept = Dots(1, 1, 1000);
  f.Commit(Define("o", {{kept, {}}, {Dots(2), {}}}), PutInstance("a", "x", "o"));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  f.Commit(Define("o", {{kept, Shift(1)}}));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_LT(pair.size, kept->bytes());
  EXPECT_EQ(pair.model.geometries().size(), 1u);
}

TEST(EngineDelta, AfterForgettingEverythingIsSentAnew) {
  StoreFixture f;
  f.Commit(Put("a", "x"), Put("b", "y"));
  Pair pair;
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  pair.scene.Forget();
  pair.model = SceneModel();  // another engine
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.drawables().size(), 2u);
  pair.scene.Forget();  // the same engine: the reset makes room for the same ids
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(pair.model.drawables().size(), 2u);
}

TEST(EngineDelta, ItBreathesDuringLongWork) {
  StoreFixture f;
  std::vector<Operation> all;
  all.reserve(5000);
  for (int i = 0; i < 5000; ++i) all.push_back(Put("a", std::to_string(i)));
  f.CommitAll(f.me, std::move(all));
  int breaths = 0;
  EngineScene scene([&] { ++breaths; });
  const size_t size = scene.Plan(f.store.snapshot());
  EXPECT_GE(breaths, 15);
  breaths = 0;
  std::vector<uint64_t> words(size / 8 + 2);
  gpu::DeltaWriter writer(std::as_writable_bytes(std::span(words)));
  scene.Write(writer);
  EXPECT_GE(breaths, 30);
}

TEST(EngineDelta, ArraysInBulkMemoryAreReferredTo) {
  const auto pool = gpu::BulkPool::Create();
  auto large = std::make_shared<GeometryData>();
  large->record.kind = gpu::PrimitiveKind::kPoints;
  large->record.vertex_count = 1000;
  large->arrays = *gpu::GeometryArrays::Allocate(large->record, pool.get());
  const std::span<float> positions = large->arrays.writable_positions();
  std::iota(positions.begin(), positions.end(), 0.0f);
  StoreFixture f;
  Pair pair;
  f.Commit(Put("a", "large", Entity1(GeometryPtr(std::move(large)))), Put("a", "small", 2));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_LT(pair.size, 3000u) << "the array alone has 12,000 bytes";
  size_t seen = 0;
  for (const auto& [id, geometry] : pair.model.geometries()) {
    seen = std::max(seen, geometry.positions.size());
    EXPECT_EQ(geometry.positions.back(), geometry.positions.size() == 3000 ? 2999 : 0);
  }
  EXPECT_EQ(seen, 3000u);
}

// Along random paths over random snapshots, the engine holds what a new engine would hold.
TEST(EngineDelta, AnyPathLeadsToTheSameScene) {
  for (uint32_t seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    StoreFixture f;
    std::vector<SnapshotPtr> snapshots = {f.store.snapshot()};
    for (int commit = 0; commit < 40; ++commit) {
      f.now += random() % 8;
      f.store.Expire(f.now);
      std::vector<Operation> all = testing::RandomOperations(random, 12);
      for (Operation& op : all) op.sequence = ++f.last_sequence;
      const Author author = testing::MakeAuthor(1 + random() % 2, 11);
      f.CommitAll(author, std::move(all));
      ASSERT_EQ(testing::CheckIndices(*f.store.snapshot()), "") << "seed " << seed;
      snapshots.push_back(f.store.snapshot());
    }
    std::vector<std::vector<std::string>> want;
    for (const SnapshotPtr& snapshot : snapshots) {
      Pair fresh;
      ASSERT_TRUE(fresh.Bring(snapshot).ok());
      want.push_back(fresh.model.Canonical());
    }
    Pair walker;
    for (int step = 0; step < 120; ++step) {
      // Mostly one step forward, as in production; otherwise to any snapshot.
      const size_t at = step < 41 ? step % snapshots.size() : random() % snapshots.size();
      const absl::Status status = walker.Bring(snapshots[at]);
      ASSERT_TRUE(status.ok()) << status << " seed " << seed << " step " << step;
      ASSERT_EQ(walker.model.Canonical(), want[at]) << "seed " << seed << " step " << step;
      if (random() % 40 == 0) walker.scene.Forget();
    }
    ASSERT_TRUE(walker.Bring(snapshots[0]).ok());
    EXPECT_EQ(walker.scene.geometries(), 0u);
    EXPECT_TRUE(walker.model.geometries().empty());
  }
}

TEST(EngineDelta, EntitiesAreDrawnWhereTheyAreChosenToBe) {
  StoreFixture f;
  const GeometryPtr shared = Dots(3);
  f.Commit(Put("a", "cpu", Entity1(shared)), Put("a", "gpu", Entity1(shared)), Put("a", "none", 7));
  DrawnWhere cpu = DrawnWhere::kCpu;
  Pair pair{EngineScene(nullptr,
                        [&](const OwnedName& layer, const std::string& id, const Entity&) {
                          EXPECT_EQ(layer.name, "a");
                          return id == "cpu"    ? cpu
                                 : id == "none" ? DrawnWhere::kNowhere
                                                : DrawnWhere::kEngine;
                        }),
            {},
            0};
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  const auto ways = [&] {
    std::multiset<gpu::DrawnBy> all;
    for (const auto& [id, drawable] : pair.model.drawables()) {
      all.insert(pair.model.geometries().at(drawable.geometry).record.drawn_by);
    }
    return all;
  };
  // A geometry that is drawn in both ways exists twice.
  EXPECT_EQ(ways(), (std::multiset<gpu::DrawnBy>{gpu::DrawnBy::kEngine, gpu::DrawnBy::kCpu}));
  EXPECT_EQ(pair.model.geometries().size(), 2u);
  cpu = DrawnWhere::kEngine;
  f.Commit(Move("a", "cpu", Shift(1)));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_EQ(ways(), (std::multiset<gpu::DrawnBy>{gpu::DrawnBy::kEngine, gpu::DrawnBy::kEngine}));
  EXPECT_EQ(pair.model.geometries().size(), 1u);
  f.Commit(DeleteId("a", "cpu"), DeleteId("a", "gpu"), DeleteId("a", "none"));
  ASSERT_TRUE(pair.Bring(f.store.snapshot()).ok());
  EXPECT_TRUE(pair.model.drawables().empty());
  EXPECT_EQ(pair.scene.geometries(), 0u);
}

}  // namespace
}  // namespace voxeld::daemon
