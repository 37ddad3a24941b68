// Tests points without thickness in many arrangements: many in one place, in order, none; in
// several layers; inserted and removed.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

using Corner = std::array<float, 3>;

class PointClouds : public EngineConformance {
 protected:
  // Inserts `count` points between two corners, each with a colour of its own.
  ModelGeometry& Put(uint64_t id, uint64_t layer, uint32_t count, Corner lo, Corner hi) {
    std::mt19937_64 random(id);
    scene_.layers[layer].id = layer;
    scene_.layers[layer].order = static_cast<int32_t>(layer);
    ModelGeometry& g = scene_.geometries[id];
    g = {};
    g.record.id = id;
    g.record.kind = PrimitiveKind::kPoints;
    g.record.color_mode = ColorMode::kPerVertex;
    g.record.vertex_count = count;
    for (uint32_t i = 0; i < count; ++i) {
      for (size_t a = 0; a < 3; ++a) {
        g.positions.push_back(std::uniform_real_distribution<float>(lo[a], hi[a])(random));
      }
      g.colors.push_back(static_cast<uint32_t>(random() & 0xFFFFFF));
    }
    scene_.drawables[id] = {.id = id, .geometry = id, .layer = layer, .priority = 1};
    return g;
  }
  void ExpectDrawn() { DrawnLikeOracle(scene_, target_); }

  const Target target_ = CubeTarget(70);  // not a multiple of a region's sides
  SceneModel scene_;
};

INSTANTIATE_TEST_SUITE_P(Engines, PointClouds, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

constexpr Corner kBelow = {-10, -10, -10}, kAbove = {80, 80, 80};

TEST_P(PointClouds, AllOverAndBeyond) {
  Put(1, 1, 20'000, kBelow, kAbove);
  ExpectDrawn();
}

TEST_P(PointClouds, InOneRegionOrOneVoxel) {
  Put(1, 1, 40'000, {32, 0, 16}, {63, 31, 31});
  Put(2, 1, 300, kBelow, kAbove);
  ExpectDrawn();
  Put(3, 1, 5'000, {40.1F, 3.1F, 20.1F}, {40.9F, 3.9F, 20.9F});
  ExpectDrawn();
}

// Neighbouring points are consecutive, in groups of all sizes.
TEST_P(PointClouds, InOrder) {
  ModelGeometry& g = Put(1, 1, 20'000, kBelow, kAbove);
  std::vector<uint32_t> order;
  for (uint32_t i = 0; i < g.record.vertex_count; ++i) order.push_back(i);
  const auto place = [&](uint32_t i) {
    return std::array{std::floor(g.positions[i * 3 + 2] / 16), g.positions[i * 3]};
  };
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return place(a) < place(b); });
  g.indices = order;
  g.record.index_count = g.record.vertex_count;
  ExpectDrawn();
}

TEST_P(PointClouds, Nowhere) {
  Put(1, 1, 3'000, {-500, -500, -500}, {-1, -1, -1});
  Put(2, 1, 3'000, {200, 3, 3}, {2000, 60, 60});
  EXPECT_EQ(CountLit(DrawnLikeOracle(scene_, target_)), 0u);
}

TEST_P(PointClouds, FarAway) {
  ModelGeometry& g = Put(1, 1, 2'000, kBelow, kAbove);
  g.positions[0] = 1.0e6F;
  g.positions[4] = -1.04e6F;
  ExpectDrawn();
  for (const float far : {1.1e6F, 3e9F, 1e30F}) {
    g.positions[7] = far;
    g.positions[9] = -far;
    ExpectDrawn();
  }
}

TEST_P(PointClouds, OfOneColorWithATintUnderATransform) {
  ModelGeometry& g = Put(1, 1, 5'000, {-1, -1, -1}, {1, 1, 1});
  g.record.color_mode = ColorMode::kUniform;
  g.record.color = 0x80FF10;
  g.colors.clear();
  scene_.drawables[1].tint = 0x40C0FF;
  scene_.drawables[1].transform.m[0] = 30;
  scene_.drawables[1].transform.m[1] = -11.3;
  scene_.drawables[1].transform.m[3] = 35.2;
  scene_.drawables[1].transform.m[5] = 27.7;
  scene_.drawables[1].transform.m[7] = 34.9;
  scene_.drawables[1].transform.m[10] = -36.1;
  scene_.drawables[1].transform.m[11] = 35.5;
  ExpectDrawn();
  scene_.drawables[1].transform = {{0, 0, 0, 12, 0, 0, 0, 13, 0, 0, 0, 14}};
  EXPECT_EQ(CountLit(DrawnLikeOracle(scene_, target_)), 1u);
}

TEST_P(PointClouds, InLayersWithPrioritiesAndErasing) {
  Put(1, 1, 20'000, kBelow, {40, 40, 40});
  Put(2, 1, 20'000, kBelow, {40, 40, 40});
  scene_.drawables[2].priority = 3;
  Put(3, 1, 20'000, kBelow, {40, 40, 40});
  scene_.drawables[3].priority = 2;
  scene_.drawables[3].erase = 1;
  Put(4, 2, 20'000, {20, 20, 20}, kAbove);
  scene_.layers[2].opacity = 130;
  Put(5, 3, 9'000, {20, 20, 20}, kAbove);
  scene_.layers[3].blend = BlendMode::kAdd;
  Put(6, 4, 9'000, {20, 20, 20}, kAbove);
  scene_.layers[4].blend = BlendMode::kErase;
  scene_.layers[4].plane_count = 1;
  scene_.layers[4].planes[0] = {1, 1, 0, -70};
  ExpectDrawn();
  // Together with other shapes, and as a mask.
  scene_.geometries[7] = SolidBox(7, {30, 30, 30}, {30, 20, 10}, 0x3040FF);
  scene_.drawables[7] = {.id = 7, .geometry = 7, .layer = 2, .priority = 1};
  scene_.layers[2].has_mask = 1;
  scene_.layers[2].mask = 3;
  ExpectDrawn();
}

TEST_P(PointClouds, OfMoreLayersThanHaveListsOfTheirOwn) {
  for (uint64_t id = 1; id <= 12; ++id) Put(id, id, 1'500, kBelow, kAbove);
  scene_.layers[5].opacity = 99;
  ExpectDrawn();
}

// The same scene again and again with a part of it changed: drawn as if it were new.
TEST_P(PointClouds, ComeAndLeave) {
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  DeltaBuffer delta;
  for (uint64_t id = 1; id <= 20; ++id) {
    Put(id, 1 + id % 2, 100 + 150 * static_cast<uint32_t>(id % 7), kBelow, kAbove);
  }
  // Two with the same points, and two with the same voxels.
  scene_.geometries[2].positions = scene_.geometries[1].positions;
  scene_.geometries[2].colors = scene_.geometries[1].colors;
  scene_.geometries[2].record.vertex_count = scene_.geometries[1].record.vertex_count;
  scene_.drawables[2].layer = scene_.drawables[1].layer;
  Put(21, 1, 2'000, {5, 5, 5}, {8, 8, 8});
  Put(22, 1, 2'000, {5, 5, 5}, {8, 8, 8});
  delta.PutWhole(scene_);
  const auto expect = [&](const std::string& what) {
    SCOPED_TRACE(what);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene_, target_);
    delta = {};
  };
  expect("all of them");
  const auto drop = [&](uint64_t id) {
    scene_.drawables.erase(id);
    scene_.geometries.erase(id);
    delta.Drop(Op::kDropDrawable, id);
    delta.Drop(Op::kDropGeometry, id);
  };
  for (const uint64_t id : {2, 5, 6, 22}) drop(id);
  expect("without some");
  const auto put = [&](uint64_t id) {
    delta.Put(scene_.geometries[id]);
    delta.Put(scene_.drawables[id]);
  };
  for (uint64_t id = 30; id < 34; ++id) {
    Put(id, 1, 700, kBelow, kAbove);
    put(id);
  }
  drop(21);
  expect("with others in place of them");
  scene_.drawables[30].transform.m[3] = 3.3;
  scene_.drawables[1].priority = 4;
  scene_.layers[2].visible = 0;
  for (const uint64_t id : {1, 30}) delta.Put(scene_.drawables[id]);
  delta.Put(scene_.layers[2]);
  expect("some moved, a layer hidden");
  scene_.layers[2].visible = 1;
  scene_.layers[2].transform.m[7] = -4;
  delta.Put(scene_.layers[2]);
  expect("seen again, somewhere else");
  for (uint64_t id = 3; id < 20; ++id) {
    if (scene_.drawables.contains(id) && id != 9) drop(id);
  }
  expect("without the most of them");
  for (const uint64_t id : {1, 9, 20, 30, 31, 32, 33}) drop(id);
  expect("without any");
  Put(40, 2, 12, kBelow, kAbove);
  put(40);
  expect("a few");
}

}  // namespace
}  // namespace voxeld::gpu::conformance
