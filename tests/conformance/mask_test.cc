// Layers that are seen only where another covers, and layers above others with many entities.
#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace mask_test {

constexpr uint32_t kRed = 0xFF0000, kBlue = 0x0000FF;
constexpr uint64_t kSide = 40, kFace = kSide * kSide, kMaskFace = 20 * 20;

// Layer 1, red, fills everything. Layer 2, below it and blue, is a box in the middle, in 8 tiles,
// none of them full. Layer 3 is empty.
class Masks : public EngineConformance {
 protected:
  Masks() {
    for (const uint64_t id : {1, 2, 3}) scene_.layers[id].id = id;
    scene_.layers[2].order = -1;
    scene_.geometries[1] = SolidBox(1, {20, 20, 20}, {40, 40, 40}, kRed);
    scene_.geometries[2] = SolidBox(2, {20, 20, 20}, {20, 20, 20}, kBlue);
    for (const uint64_t id : {1, 2}) scene_.drawables[id] = {.id = id, .geometry = id, .layer = id};
  }

  LayerRecord& layer(uint64_t id) { return scene_.layers[id]; }
  void Mask(uint64_t id, uint64_t by) {
    layer(id).has_mask = 1;
    layer(id).mask = by;
  }

  // Returns the number of voxels of one colour when the scene is drawn whole; checks them against
  // the oracle.
  uint64_t Count(uint32_t rgb) { return Count(DrawnLikeOracle(scene_, target_), rgb); }
  static uint64_t Count(const std::vector<uint32_t>& voxels, uint32_t rgb) {
    return static_cast<uint64_t>(std::count(voxels.begin(), voxels.end(), rgb));
  }

  const Target target_ = CubeTarget(kSide);
  SceneModel scene_;
};

INSTANTIATE_TEST_SUITE_P(Engines, Masks, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Masks, OnlyWhatTheMaskCoversIsSeen) {
  EXPECT_EQ(Count(kRed), kSide * kFace);
  Mask(1, 2);
  EXPECT_EQ(Count(kRed), 20 * kMaskFace);
  EXPECT_EQ(Count(kBlue), 0u);
  layer(1).visible = 0;
  EXPECT_EQ(Count(kBlue), 20 * kMaskFace);
}

TEST_P(Masks, HowAMaskLooksMakesNoDifference) {
  Mask(1, 2);
  layer(2).visible = 0;
  EXPECT_EQ(Count(kRed), 20 * kMaskFace);
  layer(2).opacity = 0;
  layer(2).order = 9;
  layer(2).blend = BlendMode::kErase;
  EXPECT_EQ(Count(kRed), 20 * kMaskFace);
  Mask(2, 3);  // so that it is not visible itself
  EXPECT_EQ(Count(kRed), 20 * kMaskFace);
  scene_.geometries[2].record.color = 0;  // black covers too
  EXPECT_EQ(Count(kRed), 20 * kMaskFace);
}

TEST_P(Masks, ClipsCutBoth) {
  Mask(1, 2);
  layer(2).visible = 0;
  layer(2).plane_count = 1;
  layer(2).planes[0] = {1, 0, 0, -25};
  EXPECT_EQ(Count(kRed), 5 * kMaskFace);
  layer(1).has_region = 1;
  layer(1).region = {{0, 0, 12}, {40, 40, 13}};
  EXPECT_EQ(Count(kRed), 5 * 20u);
}

TEST_P(Masks, WithoutItsMaskALayerIsNotSeen) {
  Mask(1, 3);
  EXPECT_EQ(Count(kRed), 0u);
  EXPECT_EQ(Count(kBlue), 20 * kMaskFace);
  Mask(1, 77);
  EXPECT_EQ(Count(kRed), 0u);
  EXPECT_EQ(Count(kBlue), 20 * kMaskFace);
}

TEST_P(Masks, OneMayMaskItselfAndTwoEachOther) {
  Mask(1, 1);
  EXPECT_EQ(Count(kRed), kSide * kFace);
  Mask(1, 2);
  Mask(2, 1);
  EXPECT_EQ(Count(kRed), 20 * kMaskFace);
  layer(1).visible = 0;
  EXPECT_EQ(Count(kBlue), 20 * kMaskFace);
}

TEST_P(Masks, WhatIsNotInItIsNotErasedFromBelow) {
  layer(1).blend = BlendMode::kErase;
  Mask(1, 3);
  scene_.geometries[3] = SolidBox(3, {20, 20, 14}, {20, 20, 8}, kRed);
  scene_.drawables[3] = {.id = 3, .geometry = 3, .layer = 3};
  layer(3).visible = 0;
  EXPECT_EQ(Count(kBlue), 12 * kMaskFace);
}

// Every step is a delta of its own, for one engine.
TEST_P(Masks, ChangesOfEitherShow) {
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  DeltaBuffer whole;
  whole.PutWhole(scene_);
  ASSERT_TRUE(engine.Apply(whole).ok());
  const auto red_after = [&](const DeltaBuffer& delta) {
    EXPECT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene_, target_);
    return Count(engine.Voxels(), kRed);
  };
  const auto put_layer = [&](uint64_t id) {
    DeltaBuffer delta;
    delta.Put(layer(id));
    return red_after(delta);
  };
  const auto put_drawable = [&](uint64_t id) {
    DeltaBuffer delta;
    delta.Put(scene_.drawables[id]);
    return red_after(delta);
  };
  Mask(1, 2);
  EXPECT_EQ(put_layer(1), 20 * kMaskFace);
  layer(2).visible = 0;
  EXPECT_EQ(put_layer(2), 20 * kMaskFace);
  scene_.drawables[2].transform.m[3] = 15;  // a part of it is outside the volume
  EXPECT_EQ(put_drawable(2), 15 * kMaskFace);
  layer(2).transform.m[3] = -15;
  EXPECT_EQ(put_layer(2), 20 * kMaskFace);
  layer(1).visible = 0;
  EXPECT_EQ(put_layer(1), 0u);
  layer(2).plane_count = 1;  // while nothing needs it
  layer(2).planes[0] = {0, 1, 0, -20};
  EXPECT_EQ(put_layer(2), 0u);
  scene_.drawables[2].transform.m[3] = 20;
  EXPECT_EQ(put_drawable(2), 0u);
  layer(1).visible = 1;
  EXPECT_EQ(put_layer(1), 20 * kMaskFace / 2);
  {
    DeltaBuffer delta;
    delta.Drop(Op::kDropDrawable, 2);
    delta.Drop(Op::kDropLayer, 2);
    const DrawableRecord drawable = scene_.drawables[2];
    const LayerRecord mask = layer(2);
    scene_.drawables.erase(2);
    scene_.layers.erase(2);
    EXPECT_EQ(red_after(delta), 0u);
    scene_.layers[2] = mask;
    EXPECT_EQ(put_layer(2), 0u);  // exists again, and is empty
    scene_.drawables[2] = drawable;
    EXPECT_EQ(put_drawable(2), 20 * kMaskFace / 2);
  }
  layer(1).has_mask = 0;
  EXPECT_EQ(put_layer(1), kSide * kFace);
}

// A layer that draws where nothing is visible costs nothing.
TEST_P(Masks, AHiddenMaskOfNoneIsNotDrawn) {
  layer(2).visible = 0;
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  DeltaBuffer whole;
  whole.PutWhole(scene_);
  ASSERT_TRUE(engine.Apply(whole).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  const auto drawn = [&] {
    scene_.drawables[2].transform.m[3] += 1;
    DeltaBuffer delta;
    delta.Put(scene_.drawables[2]);
    EXPECT_TRUE(engine.Apply(delta).ok());
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    EXPECT_TRUE(frame.ok()) << frame.status();
    return frame.value_or(FrameResult{}).tiles_drawn;
  };
  EXPECT_EQ(drawn(), 0u);
  Mask(3, 2);
  DeltaBuffer delta;
  delta.Put(layer(3));
  ASSERT_TRUE(engine.Apply(delta).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  EXPECT_GT(drawn(), 0u);
}

// Points, each a drawable, so many in one tile that an engine may keep what the layers below a change look like.
class ManyBelow : public EngineConformance {
 protected:
  static constexpr int32_t kCube = 20, kInTile = 16;
  static constexpr uint64_t kLayers = 4, kMany = 1100, kFew = 30;

  ManyBelow() {
    for (uint64_t id = 1; id <= kLayers; ++id) {
      LayerRecord& layer = scene_.layers[id];
      layer.id = id;
      layer.order = static_cast<int32_t>(id);
      ModelGeometry& point = scene_.geometries[id];
      point.record.id = id;
      point.record.kind = PrimitiveKind::kPoints;
      point.record.vertex_count = 1;
      point.record.color = static_cast<uint32_t>(0x3F1F0F << id);
      point.positions = {0.5f, 0.5f, 0.5f};
      for (uint64_t i = 0; i < (id == 1 ? kMany : kFew); ++i) Place(id * 10'000 + i, id);
    }
    scene_.layers[2].opacity = 100;
    scene_.layers[3].blend = BlendMode::kAdd;
  }

  DrawableRecord& Place(uint64_t id, uint64_t layer) {
    DrawableRecord& drawable = scene_.drawables[id];
    drawable.id = id;
    drawable.geometry = drawable.layer = layer;
    for (const int a : {3, 7, 11}) drawable.transform.m[a] = Below(kInTile);
    return drawable;
  }
  int Below(int end) { return static_cast<int>(random_() % static_cast<uint32_t>(end)); }

  // Changes a layer, most often an upper one, or something in it.
  DeltaBuffer Change() {
    DeltaBuffer delta;
    for (auto& [id, layer] : scene_.layers) {
      if (layer.has_mask == 0 || Below(2) == 0) continue;
      layer.has_mask = 0;
      delta.Put(layer);
      return delta;
    }
    const auto id = static_cast<uint64_t>(Below(20) == 0 ? 1 : 2 + Below(kLayers - 1));
    LayerRecord& layer = scene_.layers[id];
    const uint64_t drawable = id * 10'000 + static_cast<uint64_t>(Below(kFew));
    // The layer with many stays below.
    switch (id == 1 ? 7 + Below(2) : Below(12)) {
      case 0:
        layer.visible ^= 1;
        break;
      case 1:
        layer.order = 1 + Below(2 * kLayers);
        break;
      case 2:
        layer.opacity = static_cast<uint32_t>(Below(256));
        break;
      case 3:
        layer.blend = static_cast<BlendMode>(Below(3));
        break;
      case 4:
        layer.has_mask = 1;
        layer.mask = static_cast<uint64_t>(1 + Below(kLayers));
        break;
      case 5:
        layer.plane_count ^= 1;
        layer.planes[0] = {1, 0, 0, -static_cast<double>(Below(kInTile))};
        break;
      case 6:
        layer.transform.m[3] = Below(4);
        break;
      case 7:
      case 8:
        if (scene_.drawables.erase(drawable) > 0) {
          delta.Drop(Op::kDropDrawable, drawable);
          return delta;
        }
        [[fallthrough]];
      default:
        delta.Put(Place(drawable, id));
        return delta;
    }
    delta.Put(layer);
    return delta;
  }

  std::mt19937 random_{5};
  const Target target_ = CubeTarget(kCube);
  SceneModel scene_;
};

INSTANTIATE_TEST_SUITE_P(Engines, ManyBelow, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(ManyBelow, ChangesAboveAndBelowShow) {
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target_).ok());
  DeltaBuffer whole;
  whole.PutWhole(scene_);
  ASSERT_TRUE(engine.Apply(whole).ok());
  for (int step = 0; step < 400 && !HasFatalFailure(); ++step) {
    SCOPED_TRACE(step);
    for (int changes = 1 + Below(3); changes > 0; --changes) {
      ASSERT_TRUE(engine.Apply(Change()).ok());
    }
    ExpectLikeOracle(engine, scene_, target_);
  }
}

}  // namespace mask_test
}  // namespace voxeld::gpu::conformance
