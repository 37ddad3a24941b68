// Layers of many solids that move as one, with everything that may happen between two moves.
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
    Put(kMany + 1, 2);  // one that is alone
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
  // All of it, drawn once.
  void PutUp(EngineDriver& engine, const SceneModel& scene, const Target& target) {
    ASSERT_TRUE(engine.SetTarget(target).ok());
    DeltaBuffer whole;
    whole.PutWhole(scene);
    ASSERT_TRUE(engine.Apply(whole).ok());
    ExpectLikeOracle(engine, scene, target);
  }
  // Turns, stretches and shifts it, by a little.
  LayerRecord& Move(uint64_t id) {
    LayerRecord& layer = scene_.layers[id];
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b)
        layer.transform.m[a * 4 + b] = (a == b ? 1 : 0) + Random(-0.2, 0.2);
      layer.transform.m[a * 4 + 3] = Random(-3, 3);
    }
    return layer;
  }
  // Of one frame: what has come to pass since the last one.
  void Change(DeltaBuffer& delta) {
    switch (random_() % 9) {
      case 0:
        return delta.Put(Put(1 + random_() % kMany, 1));
      case 1: {
        const uint64_t id = 1 + random_() % kMany;
        if (scene_.drawables.erase(id) > 0) delta.Drop(Op::kDropDrawable, id);
        return;
      }
      case 2:  // goes to the other layer, or comes from there
        return delta.Put(Put(1 + random_() % kMany, 1 + random_() % 2));
      case 3:
        scene_.layers[1].visible ^= 1;
        return delta.Put(scene_.layers[1]);
      case 4:
        scene_.layers[1].opacity = static_cast<uint32_t>(random_() % 256);
        return delta.Put(scene_.layers[1]);
      case 5:
        return delta.Put(Move(2));
      case 6: {  // flat: nothing of it has an inverse
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

// More of them than there is room for lists of their own, at first where none of them is seen.
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
      ASSERT_TRUE(engine.Apply(delta).ok());  // several may come before they are drawn
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
