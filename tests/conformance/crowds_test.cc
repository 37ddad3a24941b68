// Tests layers of many solids that move as one, with every change that may happen between two
// moves.
#include <algorithm>
#include <cstdint>
#include <random>
#include <string>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

constexpr int32_t kSide = 48;
constexpr uint64_t kMany = 300;

class Crowds : public EngineConformance {
 protected:
  Crowds() {
    for (uint64_t kind = 1; kind <= 3; ++kind) {
      ModelGeometry& g = scene_.geometries[kind];
      g.record.id = kind;
      g.record.kind = kind == 1   ? PrimitiveKind::kBox
                      : kind == 2 ? PrimitiveKind::kSphere
                                  : PrimitiveKind::kCylinder;
      g.record.color = 0x402010u * static_cast<uint32_t>(kind);
      const float params[] = {0, 0.25f, 0, 2.5f, 3, 2};
      std::copy(std::begin(params), std::end(params), g.record.params);
    }
    for (uint64_t layer = 1; layer <= 2; ++layer) {
      scene_.layers[layer].id = layer;
      scene_.layers[layer].order = static_cast<int32_t>(layer);
    }
    for (uint64_t id = 1; id <= kMany; ++id) Put(id, 1);
    Put(kMany + 1, 2);  // one that moves alone
  }

  double Random(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  DrawableRecord& Put(uint64_t id, uint64_t layer) {
    DrawableRecord& d = scene_.drawables[id];
    d = {.id = id, .geometry = 1 + random_() % 3, .layer = layer};
    d.priority = static_cast<uint32_t>(random_() % 3);
    d.tint = random_() % 2 != 0 ? 0xFFFFFF : 0x80FF40;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) d.transform.m[a * 4 + b] = (a == b ? 1 : 0) + Random(-0.4, 0.4);
      d.transform.m[a * 4 + 3] = Random(-4, kSide + 4);
    }
    return d;
  }
  // Draws the whole scene once.
  void PutUp(EngineDriver& engine, const SceneModel& scene, const Target& target) {
    ASSERT_TRUE(engine.SetTarget(target).ok());
    DeltaBuffer whole;
    whole.PutWhole(scene);
    ASSERT_TRUE(engine.Apply(whole).ok());
    ExpectLikeOracle(engine, scene, target);
  }
  // Turns, stretches and shifts it a little.
  LayerRecord& Move(uint64_t id) {
    LayerRecord& layer = scene_.layers[id];
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b)
        layer.transform.m[a * 4 + b] = (a == b ? 1 : 0) + Random(-0.2, 0.2);
      layer.transform.m[a * 4 + 3] = Random(-3, 3);
    }
    return layer;
  }
  // Makes the changes of one frame.
  void Change(DeltaBuffer& delta) {
    switch (random_() % 9) {
      case 0:
        return delta.Put(Put(1 + random_() % kMany, 1));
      case 1: {
        const uint64_t id = 1 + random_() % kMany;
        if (scene_.drawables.erase(id) > 0) delta.Drop(Op::kDropDrawable, id);
        return;
      }
      case 2:  // moves to the other layer, or comes from there
        return delta.Put(Put(1 + random_() % kMany, 1 + random_() % 2));
      case 3:
        scene_.layers[1].visible ^= 1;
        return delta.Put(scene_.layers[1]);
      case 4:
        scene_.layers[1].opacity = static_cast<uint32_t>(random_() % 256);
        return delta.Put(scene_.layers[1]);
      case 5:
        return delta.Put(Move(2));
      case 6: {  // flat: none of its transforms has an inverse
        LayerRecord& layer = Move(1);
        for (int i = 0; i < 3; ++i) layer.transform.m[8 + i] *= 1e-310;
        return delta.Put(layer);
      }
      default:
        return delta.Put(Move(1));
    }
  }

  std::mt19937_64 random_{SeedOr(20261124)};
  SceneModel scene_;
};

INSTANTIATE_TEST_SUITE_P(Engines, Crowds, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Crowds, MoveLikeTheOracle) {
  const Target target = CubeTarget(kSide);
  EngineDriver engine = Make();
  PutUp(engine, scene_, target);
  for (int move = 0; move < 3; ++move) {
    SCOPED_TRACE(move);
    DeltaBuffer delta;
    delta.Put(Move(1));
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene_, target);
  }
}

// Changes of style, however many, move no solid; nor do hiding and showing.
TEST_P(Crowds, LookOtherwiseWhereTheyAre) {
  const Target target = CubeTarget(kSide);
  EngineDriver engine = Make();
  PutUp(engine, scene_, target);
  LayerRecord& layer = scene_.layers[1];
  const auto expect = [&](const char* what) {
    SCOPED_TRACE(what);
    DeltaBuffer delta;
    delta.Put(layer);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene_, target);
  };
  layer.opacity = 100;
  expect("fainter");
  layer.blend = BlendMode::kAdd;
  expect("added");
  layer.plane_count = 1;
  layer.planes[0] = {1, 0.5, -0.25, -20};
  expect("cut");
  Move(1);
  expect("moved");
  layer.opacity = 220;
  expect("less faint, after a move");
  layer.visible = 0;
  expect("hidden");
  Move(1);
  expect("moved where nobody sees it");
  Move(1);
  layer.opacity = 150;
  expect("again, and fainter");
  layer.visible = 1;
  expect("shown");
  layer.visible = 0;
  Move(1);
  expect("hidden as it moves");
  layer.visible = 1;
  Move(1);
  expect("shown as it moves");
}

TEST_P(Crowds, HiddenOnesThatMoveDrawNothingAnew) {
  const Target target = CubeTarget(kSide);
  EngineDriver engine = Make();
  scene_.layers[1].visible = 0;
  PutUp(engine, scene_, target);
  for (int move = 0; move < 2; ++move) {
    DeltaBuffer delta;
    delta.Put(Move(1));
    ASSERT_TRUE(engine.Apply(delta).ok());
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_EQ(frame->tiles_drawn, 0u);
    EXPECT_FALSE(frame->changed);
  }
}

// A layer masks another, whether it is visible or not, and is masked itself.
TEST_P(Crowds, MaskAndAreMasked) {
  const Target target = CubeTarget(kSide);
  scene_.geometries[4] = SolidBox(4, {24, 24, 24}, {40, 36, 30}, 0x3060FF);
  scene_.layers[3] = {.id = 3, .order = 3, .has_mask = 1, .mask = 1};
  scene_.drawables[1000] = {.id = 1000, .geometry = 4, .layer = 3};
  EngineDriver engine = Make();
  PutUp(engine, scene_, target);
  for (int move = 0; move < 6; ++move) {
    SCOPED_TRACE(move);
    DeltaBuffer delta;
    LayerRecord& crowd = Move(1);
    crowd.visible = move % 3 != 1;
    crowd.has_mask = move > 2 ? 1 : 0;  // now and then by the layer that it masks
    crowd.mask = 3;
    delta.Put(crowd);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene_, target);
  }
}

TEST_P(Crowds, AreForgottenAndComeAnew) {
  const Target target = CubeTarget(kSide);
  EngineDriver engine = Make();
  PutUp(engine, scene_, target);
  for (int round = 0; round < 3; ++round) {
    SCOPED_TRACE(round);
    // A move that is never drawn, followed by a change of everything, or only of the solid that
    // moves alone.
    DeltaBuffer delta;
    delta.Put(Move(1));
    delta.Reset();
    SceneModel scene = scene_;
    if (round == 1) {
      std::erase_if(scene.drawables, [](const auto& d) { return d.second.layer == 1; });
    }
    delta.PutWhole(scene);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene, target);
    if (round == 1) continue;
    DeltaBuffer moved;
    moved.Put(Move(1));
    ASSERT_TRUE(engine.Apply(moved).ok());
    ExpectLikeOracle(engine, scene_, target);
  }
}

// More layers than there is room for lists of their own; at first none of them is visible.
TEST_P(Crowds, MayBeOfManyLayers) {
  constexpr uint64_t kLayers = 40;
  const Target target = CubeTarget(kSide);
  SceneModel scene;
  scene.geometries = scene_.geometries;
  for (uint64_t layer = 1; layer <= kLayers; ++layer) {
    scene.layers[layer] = {.id = layer, .order = static_cast<int32_t>(layer)};
    scene.layers[layer].transform.m[3] = 1000;
    for (uint64_t id : {2 * layer, 2 * layer + 1}) {
      scene.drawables[id] = Put(id, 1);
      scene.drawables[id].layer = layer;
    }
  }
  EngineDriver engine = Make();
  PutUp(engine, scene, target);
  for (const double place : {0.0, 1.5, 1000.0}) {
    DeltaBuffer delta;
    for (auto& [id, layer] : scene.layers) {
      layer.transform.m[3] = place;
      delta.Put(layer);
    }
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene, target);
  }
  DeltaBuffer more;
  DrawableRecord& last = scene.drawables[1000] = scene.drawables[2];
  last.id = 1000;
  more.Put(last);
  for (auto& [id, layer] : scene.layers) {
    layer.transform.m[3] = 2;
    more.Put(layer);
  }
  ASSERT_TRUE(engine.Apply(more).ok());
  ExpectLikeOracle(engine, scene, target);
}

TEST_P(Crowds, StayRightWhateverHappensToThem) {
  Target target = CubeTarget(kSide);
  EngineDriver engine = Make();
  PutUp(engine, scene_, target);
  for (int frame = 0; frame < 40; ++frame) {
    SCOPED_TRACE("frame " + std::to_string(frame));
    const uint64_t changes = 1 + random_() % 3;
    for (uint64_t i = 0; i < changes; ++i) {
      DeltaBuffer delta;
      Change(delta);
      if (delta.bytes().empty()) continue;
      ASSERT_TRUE(engine.Apply(delta).ok());  // several may be applied before they are drawn
    }
    if (frame % 16 == 15) {
      for (double& m : target.view.m) m *= 1.0625;
      ASSERT_TRUE(engine.SetTarget(target).ok());
    }
    ExpectLikeOracle(engine, scene_, target);
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace voxeld::gpu::conformance
