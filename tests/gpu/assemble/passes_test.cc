// Tests scenes that do not fit into the budget of the index: they are drawn as the oracle draws
// them, and the budget is never exceeded.
#include "gpu/assemble/passes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "gpu/assemble/draw.h"
#include "gpu/assemble/volume.h"
#include "gpu/word.h"
#include "tests/conformance/oracle.h"
#include "tests/conformance/scene_model.h"

namespace voxeld::gpu {
namespace {

using conformance::DeltaBuffer;
using conformance::ModelGeometry;
using conformance::SceneModel;

constexpr int32_t kSize[3] = {96, 80, 64};  // 6 × 5 × 4 tiles

Target TargetOfSize() {
  Target target;
  target.geometry.grid = {kSize[0], kSize[1], kSize[2], {1, 1, 1}, {}};
  return target;
}

// Returns `items` items of `corners` corners each, within `extent` voxels, or anywhere; of one
// colour each, except every 50th.
ModelGeometry Items(uint64_t id, PrimitiveKind kind, size_t corners, size_t items, float extent) {
  std::mt19937_64 random(id);
  std::uniform_real_distribution<float> unit(0, 1);
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = kind;
  g.record.color_mode = ColorMode::kPerVertex;
  g.record.vertex_count = static_cast<uint32_t>(items * corners);
  for (size_t i = 0; i < items; ++i) {
    float origin[3], range[3];
    for (int a = 0; a < 3; ++a) {
      const auto most = static_cast<float>(kSize[a]);
      range[a] = extent > 0 ? extent : most;
      origin[a] = unit(random) * (most - range[a]);
    }
    uint32_t color = static_cast<uint32_t>(random()) & 0xFFFFFF;
    for (size_t c = 0; c < corners; ++c) {
      for (int a = 0; a < 3; ++a) g.positions.push_back(origin[a] + unit(random) * range[a]);
      if (i % 50 == 0) color ^= 0x102030;
      g.colors.push_back(color);
    }
  }
  return g;
}

ModelGeometry Lines(uint64_t id, size_t count) {
  return Items(id, PrimitiveKind::kSegments, 2, count, 0);
}
ModelGeometry Mesh(uint64_t id, size_t count, float extent) {
  return Items(id, PrimitiveKind::kTriangles, 3, count, extent);
}

// Returns items that all pass through the tile in the middle.
ModelGeometry Sheaf(uint64_t id, size_t count) {
  ModelGeometry g = Lines(id, count);
  const float middle[3] = {56, 40, 40};
  for (size_t i = 0; i < g.positions.size(); i += 6) {
    for (size_t a = 0; a < 3; ++a) g.positions[i + 3 + a] = 2 * middle[a] - g.positions[i + a];
  }
  return g;
}

ModelGeometry SolidOf(uint64_t id, PrimitiveKind kind, Fill fill) {
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = kind;
  g.record.fill = fill;
  g.record.color = 0x40FF00 + static_cast<uint32_t>(id);
  for (float& p : g.record.params) p = 30;
  return g;
}

// Returns a scene with every geometry in a drawable, in one of two layers in turn.
SceneModel SceneOf(std::vector<ModelGeometry> geometries) {
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.layers[2].id = 2;
  scene.layers[2].blend = BlendMode::kAdd;
  for (ModelGeometry& g : geometries) {
    const uint64_t id = g.record.id;
    scene.drawables[id] = {.id = id, .geometry = id, .layer = 1 + id % 2};
    scene.drawables[id].priority = static_cast<uint32_t>(id % 3);
    scene.geometries[id] = std::move(g);
  }
  return scene;
}

class PassesTest : public testing::Test {
 protected:
  void Make(uint64_t index_bytes, SceneModel scene, uint64_t list_bytes = 1 << 20) {
    volume_ = std::make_unique<Volume>(*executor_, index_bytes, list_bytes);
    volume_->SetView(grid_, Affine(), std::vector<uint8_t>(grid_.count(), kOwned));
    scene_ = std::move(scene);
    DeltaBuffer delta;
    delta.PutWhole(scene_);
    Apply(delta);
  }
  void Apply(const DeltaBuffer& delta) {
    BlockSource referred(delta.referred());
    const absl::Status status = volume_->Apply(delta.bytes(), &referred);
    ASSERT_TRUE(status.ok()) << status;
  }
  void Move(uint64_t id, double x) {
    DrawableRecord& d = scene_.drawables[id];
    d.transform.m[3] = x;
    DeltaBuffer delta;
    delta.Put(d);
    Apply(delta);
  }
  // Removes the drawables 1 to `count`.
  void RemoveFirst(uint64_t count) {
    DeltaBuffer drop;
    for (uint64_t id = 1; id <= count; ++id) {
      scene_.drawables.erase(id);
      drop.Drop(Op::kDropDrawable, id);
    }
    Apply(drop);
  }
  void Put(const LayerRecord& layer) {
    scene_.layers[layer.id] = layer;
    DeltaBuffer delta;
    delta.Put(layer);
    Apply(delta);
  }
  // Checks that the scene is drawn as the oracle draws it, and, if `counted` is given, that this
  // many of its drawables are drawn in passes.
  void ExpectDrawn(std::optional<size_t> counted) {
    volume_->Update(nullptr);
    if (counted.has_value()) {
      EXPECT_EQ(volume_->counted_drawables(), *counted);
    }
    const conformance::DenseVolume want = conformance::OracleVoxels(scene_, TargetOfSize());
    uint64_t lit = 0;
    for (int32_t z = 0; z < kSize[2]; ++z) {
      for (int32_t y = 0; y < kSize[1]; ++y) {
        for (int32_t x = 0; x < kSize[0]; ++x) {
          const uint32_t* const colors = volume_->tiles().colors(grid_.TileOf(x, y, z));
          const uint32_t got = colors == nullptr ? 0 : colors[grid_.IndexInTile(x, y, z)];
          const uint32_t rgb = want.rgb[want.Index(x, y, z)];
          ASSERT_EQ(got, Interleave(rgb)) << x << ", " << y << ", " << z;
          lit += rgb != 0;
        }
      }
    }
    EXPECT_GT(lit, 100u);
    EXPECT_EQ(volume_->lit_voxels(), lit);
  }

  const TileGrid grid_ = TileGrid::Of(kSize[0], kSize[1], kSize[2]);
  const std::unique_ptr<Executor> executor_ = MakeThreadExecutor(3);
  SceneModel scene_;
  std::unique_ptr<Volume> volume_;
};

TEST_F(PassesTest, PartOfTheSceneIsOverTheBudget) {
  Make(uint64_t{1} << 19,
       SceneOf({Lines(1, 300), Lines(2, 9000), Mesh(3, 200, 8), Mesh(4, 3000, 20), Lines(5, 50)}));
  ExpectDrawn(2);
  EXPECT_LE(volume_->index_bytes(), uint64_t{1} << 19);
  // The same scene again, with a budget into which it fits.
  Make(0, scene_);
  ExpectDrawn(0);
}

TEST_F(PassesTest, LinesThroughOneTileAreDrawnByRanges) {
  for (uint64_t bytes : {uint64_t{1}, uint64_t{20'000}, uint64_t{200'000}}) {
    SCOPED_TRACE(bytes);
    Make(bytes, SceneOf({Sheaf(1, 5000), Sheaf(2, 3000)}));
    ExpectDrawn(2);
  }
}

TEST_F(PassesTest, EveryKindOverTheBudget) {
  ModelGeometry thick = Lines(1, 300), cover = Lines(2, 300), tiled = Mesh(3, 60, 60);
  thick.record.thickness = 5;
  cover.record.sampling = LineSampling::kCover;
  tiled.record.rule = SurfaceRule::kCover;
  SceneModel scene =
      SceneOf({thick, cover, tiled, Mesh(4, 40, 63), Items(5, PrimitiveKind::kPoints, 1, 3000, 0),
               SolidOf(6, PrimitiveKind::kBox, Fill::kSolid),
               SolidOf(7, PrimitiveKind::kSphere, Fill::kSurface),
               SolidOf(8, PrimitiveKind::kCylinder, Fill::kSolid)});
  for (uint64_t id : {6, 7, 8}) {
    for (size_t a = 0; a < 3; ++a) scene.drawables[id].transform.m[4 * a + 3] = 30;
  }
  scene.drawables[1].erase = 1;
  Make(512, scene);
  ExpectDrawn(8);
}

TEST_F(PassesTest, ChangesOfWhatIsCounted) {
  Make(uint64_t{1} << 19, SceneOf({Lines(1, 5000), Lines(2, 100), Mesh(3, 2500, 12)}));
  ExpectDrawn(2);
  Move(1, 7.25);
  ExpectDrawn(2);
  Move(2, -9.5);
  ExpectDrawn(2);
  LayerRecord layer = scene_.layers[2];
  layer.opacity = 100;
  Put(layer);
  ExpectDrawn(2);
  layer.visible = 0;
  Put(layer);
  ExpectDrawn(2);
  layer.visible = 1;
  Put(layer);
  // A few lines replace many, and fit.
  DeltaBuffer delta;
  scene_.drawables[1].geometry = 9;
  scene_.geometries[9] = Lines(9, 200);
  scene_.geometries.erase(1);
  delta.Put(scene_.geometries[9]);
  delta.Put(scene_.drawables[1]);
  delta.Drop(Op::kDropGeometry, 1);
  Apply(delta);
  ExpectDrawn(1);
  DeltaBuffer drop;
  scene_.drawables.erase(3);
  drop.Drop(Op::kDropDrawable, 3);
  Apply(drop);
  ExpectDrawn(0);
  // With a new view, everything is drawn again.
  volume_->SetView(grid_, Affine(), std::vector<uint8_t>(grid_.count(), kOwned));
  ExpectDrawn(0);
}

TEST_F(PassesTest, WhatWasCountedIsKeptWhenOthersHaveGone) {
  Make(uint64_t{1} << 19,
       SceneOf({Lines(1, 1500), Lines(2, 1500), Lines(3, 1500), Lines(4, 1500)}));
  volume_->Update(nullptr);
  const size_t counted = volume_->counted_drawables();
  ASSERT_GT(counted, 0u);
  ASSERT_LT(counted, 4u);
  // The first ones fitted.
  RemoveFirst(counted);
  ExpectDrawn(0);
  EXPECT_LE(volume_->index_bytes(), uint64_t{1} << 19);
  // They move to where they were.
  for (const auto& [id, drawable] : std::map(scene_.drawables)) Move(id, 5.5);
  ExpectDrawn(0);
}

TEST_F(PassesTest, TheIndexStaysWithinTheBudgetFromFrameToFrame) {
  for (uint64_t bytes : {uint64_t{1} << 16, uint64_t{1} << 17, uint64_t{1} << 18}) {
    SCOPED_TRACE(bytes);
    std::vector<ModelGeometry> geometries;
    for (uint64_t id = 1; id <= 12; ++id) geometries.push_back(Lines(id, 100 * id));
    Make(bytes, SceneOf(std::move(geometries)));
    uint64_t most = 0;
    for (int frame = 0; frame < 12; ++frame) {
      volume_->Update(nullptr);
      EXPECT_GT(volume_->counted_drawables(), 0u);
      most = std::max(most, volume_->index_bytes());
      Move(1 + static_cast<uint64_t>(frame) * 5 % 12, frame);
    }
    EXPECT_LE(most, bytes);
    EXPECT_GT(most, bytes / 16);  // what fits is kept
  }
}

SceneModel EveryKind() {
  ModelGeometry curve;
  curve.record.id = 1;
  curve.record.kind = PrimitiveKind::kCurves;
  curve.record.vertex_count = 4;
  curve.record.color = 0x20FF10;
  curve.positions = {2, 2, 2, 90, 5, 60, 5, 75, 3, 92, 77, 61};
  ModelGeometry thick = Lines(2, 300);
  thick.record.thickness = 5;
  return SceneOf(
      {curve, thick, Lines(3, 100), Mesh(4, 40, 63), Items(5, PrimitiveKind::kPoints, 1, 3000, 0)});
}

TEST_F(PassesTest, UnlistedDrawablesAreDrawnTheSame) {
  for (const uint64_t index_bytes : {uint64_t{512}, uint64_t{0}}) {
    SCOPED_TRACE(index_bytes);
    Make(index_bytes, EveryKind(), 1);
    ExpectDrawn(0);
    EXPECT_EQ(volume_->unlisted_drawables(), 5u);
    EXPECT_EQ(volume_->listed_bytes(), 0u);
  }
  Move(1, 6.5);
  Move(4, -8);
  ExpectDrawn(0);
  LayerRecord layer = scene_.layers[2];
  layer.visible = 0;
  Put(layer);
  ExpectDrawn(0);
  layer.visible = 1;
  layer.opacity = 77;
  Put(layer);
  DeltaBuffer drop;
  scene_.drawables.erase(2);
  drop.Drop(Op::kDropDrawable, 2);
  Apply(drop);
  ExpectDrawn(0);
  EXPECT_EQ(volume_->unlisted_drawables(), 4u);
  volume_->SetView(grid_, Affine(), std::vector<uint8_t>(grid_.count(), kOwned));
  ExpectDrawn(0);
  EXPECT_EQ(volume_->unlisted_drawables(), 4u);
}

TEST_F(PassesTest, ListedCountedAndUnlistedDrawablesTogether) {
  // Small drawables come first. The first of the large ones is counted; the lists have no room for the second.
  constexpr uint64_t kShare = 9000;
  SceneModel scene = SceneOf({Lines(1, 9000), Lines(2, 5), Mesh(3, 20, 8), Lines(4, 9000)});
  Make(uint64_t{1} << 19, scene, kShare);
  volume_->Update(nullptr);
  EXPECT_EQ(volume_->unlisted_drawables(), 1u);
  EXPECT_EQ(volume_->counted_drawables(), 1u);
  EXPECT_LE(volume_->listed_bytes(), kShare);
  ExpectDrawn(1);
  for (uint64_t id : {2, 4, 1}) {
    Move(id, static_cast<double>(id) * 3);
    ExpectDrawn(std::nullopt);
    EXPECT_LE(volume_->listed_bytes(), kShare);
  }
}

TEST_F(PassesTest, OneThatNeedsNearlyTheWholeBudgetIsListedOnceItFits) {
  const auto listed_bytes = [this](const ModelGeometry& geometry) {
    Make(0, SceneOf({geometry}));
    volume_->Update(nullptr);
    return volume_->listed_bytes();
  };
  const ModelGeometry small = Lines(1, 3), large = Lines(2, 400);
  const uint64_t small_bytes = listed_bytes(small), large_bytes = listed_bytes(large);
  ASSERT_LT(small_bytes, large_bytes / 4);
  Make(0, SceneOf({small, large}), large_bytes + small_bytes / 2);
  volume_->Update(nullptr);
  ASSERT_EQ(volume_->unlisted_drawables(), 1u);
  ASSERT_EQ(volume_->listed_bytes(), small_bytes);
  DeltaBuffer drop;
  scene_.drawables.erase(1);
  drop.Drop(Op::kDropDrawable, 1);
  Apply(drop);
  ExpectDrawn(0);
  EXPECT_EQ(volume_->unlisted_drawables(), 0u);
}

TEST_F(PassesTest, UnlistedDrawablesAreListedAfterOthersAreRemoved) {
  Make(0, SceneOf({Lines(1, 400), Lines(2, 400), Lines(3, 400)}), 10'000);
  volume_->Update(nullptr);
  const size_t unlisted = volume_->unlisted_drawables();
  ASSERT_GT(unlisted, 0u);
  ASSERT_LT(unlisted, 3u);
  RemoveFirst(unlisted);
  ExpectDrawn(0);
  EXPECT_EQ(volume_->unlisted_drawables(), 0u);
  // They move to where they were.
  for (const auto& [id, drawable] : std::map(scene_.drawables)) Move(id, 5.5);
  ExpectDrawn(0);
}

TEST_F(PassesTest, ListsStayWithinTheirShare) {
  std::vector<ModelGeometry> spheres;
  for (uint64_t id = 1; id <= 500; ++id) {
    spheres.push_back(SolidOf(id, PrimitiveKind::kSphere, Fill::kSolid));
  }
  SceneModel scene = SceneOf(std::move(spheres));
  for (auto& [id, drawable] : scene.drawables) {
    for (size_t a = 0; a < 3; ++a) drawable.transform.m[4 * a + 3] = 30;
  }
  constexpr uint64_t kShare = 1 << 16;
  Make(0, scene, kShare);
  volume_->Update(nullptr);
  EXPECT_LE(volume_->listed_bytes(), kShare);
  EXPECT_GT(volume_->listed_bytes(), kShare / 2);
  EXPECT_LT(volume_->unlisted_drawables(), 500u);
  // Listing all of them takes more than ten times the share.
  Make(0, scene, uint64_t{1} << 30);
  volume_->Update(nullptr);
  EXPECT_EQ(volume_->unlisted_drawables(), 0u);
  EXPECT_GT(volume_->listed_bytes(), 10 * kShare);
}

// Finding gives up before its memory exceeds the limit, and what fits is the same as without a
// limit.
TEST_F(PassesTest, FindingStaysWithinItsLimit) {
  Make(0,
       SceneOf({Lines(1, 8000), Mesh(2, 5000, 40), Items(3, PrimitiveKind::kPoints, 1, 20000, 0)}));
  int fit = 0, exceeded = 0;
  for (const auto& [id, geometry] : scene_.geometries) {
    Drawable d;
    Layer layer;
    d.layer = &layer;
    const ModelGeometry& g = geometry;
    GeometryView view;
    view.record = g.record;
    view.positions = g.positions;
    view.indices = g.indices;
    view.colors = g.colors;
    d.geometry = std::make_shared<const RetainedGeometry>(RetainedGeometry{view, nullptr});
    MapDrawable(d, Affine(), grid_, *executor_);
    const std::vector<uint8_t> owned(grid_.count(), 1);
    Bins all;
    BinScratch scratch;
    BinItems(d.source, grid_, owned, 0, false, *executor_, scratch, all);
    for (uint64_t limit = uint64_t{1} << 15; limit < uint64_t{1} << 26; limit *= 2) {
      for (bool choose : {false, true}) {
        BinScratch tight;
        Bins bins;
        const BinLimits limits = {
            .bytes = limit, .choose = choose, .box = {{0, 0, 0}, {kSize[0], kSize[1], kSize[2]}}};
        const bool fits =
            BinItems(d.source, grid_, owned, 0, false, *executor_, limits, tight, bins);
        EXPECT_LE(bins.item_bytes() + tight.bytes(), limit);
        (fits ? fit : exceeded)++;
        if (fits) {
          EXPECT_EQ(bins.tiles, all.tiles);
          EXPECT_EQ(bins.begin, all.begin);
        } else {
          EXPECT_EQ(bins.size(), 0u);
          EXPECT_EQ(bins.item_bytes(), 0u);
        }
      }
    }
  }
  EXPECT_GT(fit, 6);
  EXPECT_GT(exceeded, 6);
}

TEST(PlanPasses, RunsAreAsLongAsTheyFit) {
  const std::vector<uint64_t> items = {0, 3, 4, 0, 100, 1, 2, 3, 0, 0};
  EXPECT_TRUE(PlanPasses({}, 1000).empty());
  const auto ends = [&](uint64_t bytes) {
    std::vector<size_t> ends;
    size_t at = 0;
    for (const TileRun run : PlanPasses(items, bytes)) {
      EXPECT_EQ(run.begin, at);
      ends.push_back(at = run.end);
    }
    return ends;
  };
  EXPECT_EQ(ends(uint64_t{1} << 40), (std::vector<size_t>{10}));
  // Each tile with items, by itself.
  EXPECT_EQ(ends(0), (std::vector<size_t>{1, 2, 4, 5, 6, 7, 10}));
}

}  // namespace
}  // namespace voxeld::gpu
