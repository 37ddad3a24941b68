// Tests layers that are drawn only in a part of the scene.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include "display/geometry/footprint.h"
#include "tests/conformance/conformance_test.h"
#include "tests/conformance/oracle_clip.h"

namespace voxeld::gpu::conformance {
namespace {

constexpr uint64_t kSlab = 32 * 32;  // the voxels of a slab of the box below, one voxel thick

// Returns a stack of slices with one voxel a pixel: 48 × 48 × 32, so 3 × 3 × 2 tiles of 16.
Target StackTarget(const Affine& view = {}) {
  Target target;
  display::PlanarStack stack;
  stack.width_px = 48;
  stack.height_px = 48;
  for (int i = 0; i < 32; ++i) stack.positions_mm.push_back(i);
  target.geometry.shape = stack;
  target.geometry.grid = {48, 48, 32, {1, 1, 1}, {-24, -24, -0.5}};
  target.layout = {.slices = 32, .width = 48, .height = 48};
  target.tone.SetCurve(display::Tone::Linear());
  target.view = view;
  return target;
}

// Returns a scene with layer 1, which has a solid box of 32³ voxels from (0, 0, 0) on.
SceneModel BoxScene() {
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.geometries[1] = SolidBox(1, {16, 16, 16}, {32, 32, 32}, 0xFFFFFF);
  scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
  return scene;
}

void SetPlanes(LayerRecord& layer, const std::vector<ClipPlane>& planes) {
  layer.plane_count = static_cast<uint32_t>(planes.size());
  std::copy(planes.begin(), planes.end(), layer.planes);
}

// outer · inner, and the inverse, for making views: their last bits do not matter.
Affine Inverse(const Affine& map) {
  const auto m = [&](int i, int j) { return map.m[(i % 3) * 4 + j % 3]; };
  const double determinant = Determinant(map);
  Affine inverse;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      inverse.m[i * 4 + j] =
          (m(j + 1, i + 1) * m(j + 2, i + 2) - m(j + 1, i + 2) * m(j + 2, i + 1)) / determinant;
    }
  }
  for (int i = 0; i < 3; ++i) {
    inverse.m[i * 4 + 3] = 0;
    for (int j = 0; j < 3; ++j) inverse.m[i * 4 + 3] -= inverse.m[i * 4 + j] * map.m[j * 4 + 3];
  }
  return inverse;
}

class EngineClip : public EngineConformance {
 protected:
  // Returns how many voxels of a scene the engine lights under a view, and checks that the oracle
  // lights the same.
  uint64_t Lit(const SceneModel& scene, const Target& target) {
    return CountLit(DrawnLikeOracle(scene, target));
  }
  uint64_t LitWith(const std::vector<ClipPlane>& planes, const Affine& view = {}) {
    SceneModel scene = BoxScene();
    SetPlanes(scene.layers[1], planes);
    return Lit(scene, StackTarget(view));
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, EngineClip, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(EngineClip, BoxesCutByPlanesHaveTheVoxelsCountedByHand) {
  EXPECT_EQ(LitWith({}), 32 * kSlab);
  EXPECT_EQ(LitWith({{1, 0, 0, -10}}), 22 * kSlab);
  EXPECT_EQ(LitWith({{-1, 0, 0, 10}}), 10 * kSlab);
  // A centre in the plane is inside, whichever way the normal points and however long it is.
  EXPECT_EQ(LitWith({{0, 1, 0, -10.5}}), 22 * kSlab);
  EXPECT_EQ(LitWith({{0, -1, 0, 10.5}}), 11 * kSlab);
  EXPECT_EQ(LitWith({{0, 0, 1e200, -10.5e200}}), 22 * kSlab);
  EXPECT_EQ(LitWith({{0, 0, 1e-200, -10.5e-200}}), 22 * kSlab);
  EXPECT_EQ(LitWith({{0, 0, 1, -10.500001}}), 21 * kSlab);
  EXPECT_EQ(LitWith({{0, 0, 1, -10.499999}}), 22 * kSlab);
  // The corner with i + j + k ≤ 10: C(13, 3).
  EXPECT_EQ(LitWith({{-1, -1, -1, 11.5}}), 286u);
  EXPECT_EQ(LitWith({{-1, -1, -1, 11.4}}), 220u);
  // Several planes: a voxel must be inside all of them.
  EXPECT_EQ(LitWith({{1, 0, 0, -10}, {-1, 0, 0, 20}, {0, 1, 0, -31}}), 10u * 32);
  EXPECT_EQ(LitWith({{1, 0, 0, -20}, {-1, 0, 0, 10}}), 0u);
  const std::vector<ClipPlane> eight = {{1, 0, 0, -8},  {-1, 0, 0, 24},  {0, 1, 0, -8},
                                        {0, -1, 0, 24}, {0, 0, 1, -8},   {0, 0, -1, 24},
                                        {1, 1, 1, 0},   {0, 0, 1, 1e300}};
  EXPECT_EQ(LitWith(eight), 16u * 16 * 16);
  // All of space, and none of it.
  EXPECT_EQ(LitWith({{1e-300, 0, 0, 1e300}}), 32 * kSlab);
  EXPECT_EQ(LitWith({{1e-300, 0, 0, -1e300}}), 0u);
}

TEST_P(EngineClip, RegionsHaveTheVoxelsCountedByHand) {
  SceneModel scene = BoxScene();
  LayerRecord& layer = scene.layers[1];
  layer.has_region = 1;
  layer.region = {{4, 4, -5}, {8, 9, 50}};
  EXPECT_EQ(Lit(scene, StackTarget()), 4u * 5 * 32);
  layer.region = {{4.5, 4.5, 4.5}, {8.5, 9.5, 4.75}};  // faces through centres: those voxels are
                                                       // inside
  EXPECT_EQ(Lit(scene, StackTarget()), 5u * 6 * 1);
  layer.region = {{4.6, 4, 4}, {5.4, 8, 8}};  // between two centres
  EXPECT_EQ(Lit(scene, StackTarget()), 0u);
  layer.region = {{-1e300, -1e300, -1e300}, {1e300, 1e300, 10}};
  EXPECT_EQ(Lit(scene, StackTarget()), 10 * kSlab);
  SetPlanes(layer, {{1, 0, 0, -10}});
  EXPECT_EQ(Lit(scene, StackTarget()), 22u * 32 * 10);
}

// Planes are given in the scene: they move with the view, and stay when the layer moves.
TEST_P(EngineClip, PlanesLieInTheScene) {
  // MILLIMETRES: voxel = mm + (24, 24, ½).
  Affine millimetres;
  millimetres.m[3] = millimetres.m[7] = 24;
  millimetres.m[11] = 0.5;
  SceneModel scene = BoxScene();
  scene.layers[1].transform.m[3] = scene.layers[1].transform.m[7] = -24;
  scene.layers[1].transform.m[11] = -0.5;
  SetPlanes(scene.layers[1], {{1, 0, 0, 0}});
  EXPECT_EQ(Lit(scene, StackTarget(millimetres)), 8 * kSlab);  // voxels 24 to 31
  // FIT of [-1, 1] on the longest axis: 24 voxels a unit.
  Affine fit;
  fit.m[0] = fit.m[5] = fit.m[10] = 24;
  fit.m[3] = fit.m[7] = 24;
  fit.m[11] = 16;
  scene.layers[1].transform = Inverse(fit);
  SetPlanes(scene.layers[1], {{0, 0, 1, 0.25}});  // from z = 16 − 6 on
  EXPECT_EQ(Lit(scene, StackTarget(fit)), 22 * kSlab);
  SetPlanes(scene.layers[1], {{0, 1, 0, 0.5}});  // from y = 24 − 12 on
  EXPECT_EQ(Lit(scene, StackTarget(fit)), 20 * kSlab);
  // A quarter turn about z: the scene's x is the voxels' y; a mirror: the voxels' −z.
  Affine turned;
  turned.m[0] = turned.m[5] = 0;
  turned.m[1] = -1, turned.m[3] = 48;
  turned.m[4] = 1;
  turned.m[10] = -1, turned.m[11] = 32;
  scene.layers[1].transform = Inverse(turned);
  SetPlanes(scene.layers[1], {{1, 0, 0, -10}, {0, 0, 1, -20}});  // y ≥ 10, z ≤ 12
  EXPECT_EQ(Lit(scene, StackTarget(turned)), 22u * 32 * 12);
}

TEST_P(EngineClip, ClippedVoxelsAreNotCoveredSoThatBelowShows) {
  SceneModel scene = BoxScene();
  scene.layers[2] = scene.layers[1];
  scene.layers[2].id = 2;
  scene.geometries[2] = SolidBox(2, {16, 16, 16}, {32, 32, 32}, 0xFF0000);
  scene.drawables[2] = {.id = 2, .geometry = 2, .layer = 2};
  LayerRecord& above = scene.layers[2];
  SetPlanes(above, {{1, 0, 0, -10}});
  const Target target = StackTarget();
  const auto count = [&](uint32_t rgb) {
    EngineDriver engine = Make();
    DeltaBuffer delta;
    delta.PutWhole(scene);
    EXPECT_TRUE(engine.SetTarget(target).ok());
    EXPECT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene, target);
    const std::vector<uint32_t> voxels = engine.Voxels();
    return static_cast<uint64_t>(std::count(voxels.begin(), voxels.end(), rgb));
  };
  EXPECT_EQ(count(0xFFFFFF), 10 * kSlab);
  EXPECT_EQ(count(0xFF0000), 22 * kSlab);
  // A layer that erases does so only inside its clip.
  above.blend = BlendMode::kErase;
  EXPECT_EQ(count(0xFFFFFF), 10 * kSlab);
  EXPECT_EQ(count(0xFF0000), 0u);
  // The same for an entity that erases within its layer, and for what the CPU draws.
  above.blend = BlendMode::kOver;
  scene.geometries[2].record.drawn_by = DrawnBy::kCpu;
  scene.drawables[3] = {.id = 3, .geometry = 1, .layer = 2, .priority = 1, .erase = 1};
  scene.drawables[3].transform.m[3] = 20;  // 12 voxels of the red ones, none of the white ones
  EXPECT_EQ(count(0xFFFFFF), 22 * kSlab);
  EXPECT_EQ(count(0xFF0000), 10 * kSlab);
}

TEST_P(EngineClip, ChangesDrawTheTilesOfTheLayerAndNoOthers) {
  SceneModel scene = BoxScene();
  scene.geometries[1] = SolidBox(1, {16, 16, 16}, {20, 20, 20}, 0xFFFFFF);  // in 8 tiles
  constexpr uint64_t kThin = 20 * 20;
  scene.layers[2].id = 2;
  scene.geometries[2] = SolidBox(2, {40, 40, 8}, {4, 4, 4}, 0x00FF00);
  scene.drawables[2] = {.id = 2, .geometry = 2, .layer = 2};
  EngineDriver engine = Make();
  // Tiles of 16×16×16 voxels, or of 32×32×16.
  const uint32_t tiles = engine.engine().info().kind == EngineKind::kCuda ? 2 : 8;
  DeltaBuffer whole;
  whole.PutWhole(scene);
  ASSERT_TRUE(engine.SetTarget(StackTarget()).ok());
  ASSERT_TRUE(engine.Apply(whole).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  const auto put = [&](LayerRecord layer) {
    DeltaBuffer delta;
    delta.Put(layer);
    EXPECT_TRUE(engine.Apply(delta).ok());
    absl::StatusOr<FrameResult> frame = engine.Frame();
    EXPECT_TRUE(frame.ok()) << frame.status();
    return frame.value_or(FrameResult{});
  };
  LayerRecord layer = scene.layers[1];
  SetPlanes(layer, {{1, 0, 0, -10}});
  FrameResult frame = put(layer);
  EXPECT_EQ(frame.tiles_drawn, tiles);
  EXPECT_EQ(frame.lit_voxels, 16 * kThin + 64);
  EXPECT_EQ(put(layer).tiles_drawn, 0u);  // the same again
  layer.planes[0].d = -12;
  frame = put(layer);
  EXPECT_EQ(frame.tiles_drawn, tiles);
  EXPECT_EQ(frame.lit_voxels, 14 * kThin + 64);
  layer.planes[1] = {9, 9, 9, 9};  // beyond plane_count: ignored
  EXPECT_EQ(put(layer).tiles_drawn, 0u);
  layer.has_region = 1;
  layer.region = {{0, 0, 0}, {16, 16, 16}};
  frame = put(layer);
  EXPECT_EQ(frame.tiles_drawn, tiles);
  EXPECT_EQ(frame.lit_voxels, 4u * 10 * 10 + 64);
  layer.region.max[2] = 8;
  EXPECT_EQ(put(layer).lit_voxels, 4u * 10 * 2 + 64);
  // While the layer is hidden, its changes cost nothing.
  layer.visible = 0;
  EXPECT_EQ(put(layer).lit_voxels, 64u);
  layer.plane_count = 0;
  EXPECT_EQ(put(layer).tiles_drawn, 0u);
  layer.visible = 1;
  EXPECT_EQ(put(layer).lit_voxels, 10u * 10 * 2 + 64);
  layer.has_region = 0;
  frame = put(layer);
  EXPECT_EQ(frame.tiles_drawn, tiles);
  EXPECT_EQ(frame.lit_voxels, 20 * kThin + 64);
  // Entities that are inserted later are clipped as well.
  SetPlanes(layer, {{0, 0, 1, -25}});
  EXPECT_EQ(put(layer).lit_voxels, kThin + 64);
  DeltaBuffer moved;
  scene.drawables[1].transform.m[11] = 15;
  moved.Put(scene.drawables[1]);
  ASSERT_TRUE(engine.Apply(moved).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  scene.layers[1] = layer;
  ExpectLikeOracle(engine, scene, StackTarget());
}

TEST_P(EngineClip, ANewViewMovesThePlanes) {
  SceneModel scene = BoxScene();
  SetPlanes(scene.layers[1], {{1, 0, 0, -10}});
  EngineDriver engine = Make();
  DeltaBuffer whole;
  whole.PutWhole(scene);
  ASSERT_TRUE(engine.SetTarget(StackTarget()).ok());
  ASSERT_TRUE(engine.Apply(whole).ok());
  ExpectLikeOracle(engine, scene, StackTarget());
  Affine half;
  half.m[0] = half.m[5] = half.m[10] = 0.5;
  ASSERT_TRUE(engine.SetTarget(StackTarget(half)).ok());
  ExpectLikeOracle(engine, scene, StackTarget(half));
  EXPECT_EQ(CountLit(engine.Voxels()), 11u * 16 * 16);
  // A view without an inverse shows nothing of a clipped layer.
  Affine flat;
  flat.m[0] = 0;
  flat.m[3] = 5;
  ModelGeometry dot;
  dot.record.id = 2;
  dot.record.vertex_count = 1;
  dot.positions = {20, 3, 3};
  DeltaBuffer delta;
  delta.Put(dot);
  delta.Put(DrawableRecord{.id = 2, .geometry = 2, .layer = 1});
  ASSERT_TRUE(engine.Apply(delta).ok());
  ASSERT_TRUE(engine.SetTarget(StackTarget(flat)).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  EXPECT_EQ(CountLit(engine.Voxels()), 0u);
  DeltaBuffer unclipped;
  unclipped.Put(LayerRecord{.id = 1});
  ASSERT_TRUE(engine.Apply(unclipped).ok());
  ASSERT_EQ(engine.Frame().status(), absl::OkStatus());
  EXPECT_EQ(CountLit(engine.Voxels()), 1u);
}

// A view of each mode, with any rotation, and scenes and planes that lie in its volume.
TEST_P(EngineClip, RandomPlanesUnderEveryKindOfViewEqualTheOracle) {
  constexpr int kSize = 24;
  const uint64_t seed = SeedOr(6000);
  EngineDriver engine = Make();
  uint64_t lit = 0, unclipped = 0, verdicts = 0, near = 0;
  for (uint64_t i = 0; i < 120; ++i) {
    SCOPED_TRACE("VOXELD_SEED=" + std::to_string(seed + i));
    SceneGenerator generator(seed + i);
    Target target = generator.RandomTarget();
    const display::VoxelGrid& grid = target.geometry.grid;
    const double pitch[3] = {grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z};
    const double origin[3] = {grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z};
    const int32_t cells[3] = {grid.nx, grid.ny, grid.nz};
    Affine mode;  // VOXELS
    double longest = 0;
    for (int a = 0; a < 3; ++a) longest = std::max(longest, cells[a] * pitch[a]);
    for (int a = 0; a < 3 && i % 3 != 0; ++a) {
      const bool fit = i % 3 == 1;
      mode.m[a * 5] = fit ? longest / 2 / pitch[a] : 1 / pitch[a];
      mode.m[a * 4 + 3] = fit ? cells[a] / 2.0 : -origin[a] / pitch[a];
    }
    Affine turn;  // view.transform
    const double angle = generator.Real(0, 7), tilt = generator.Real(0, 7);
    const double c = std::cos(angle), s = std::sin(angle), u = std::cos(tilt), w = std::sin(tilt);
    const double rows[9] = {c, -s, 0, s * u, c * u, -w, s * w, c * w, u};
    if (i % 2 == 0) {
      for (int k = 0; k < 9; ++k) turn.m[k / 3 * 4 + k % 3] = rows[k];
      for (int r = 0; r < 3; ++r) turn.m[r * 4 + 3] = generator.Real(-1, 1);
    }
    target.view = Compose(mode, turn);
    SceneModel scene = generator.RandomScene(kSize);
    const Affine back = Inverse(target.view);
    for (auto& [id, layer] : scene.layers) {
      layer.transform = Compose(back, layer.transform);
      // The plane, given for voxels, in the scene: n·A and d + n·t.
      for (uint32_t p = 0; p < layer.plane_count; ++p) {
        const ClipPlane v = layer.planes[p];
        const double* m = target.view.m;
        layer.planes[p] = {
            v.a * m[0] + v.b * m[4] + v.c * m[8], v.a * m[1] + v.b * m[5] + v.c * m[9],
            v.a * m[2] + v.b * m[6] + v.c * m[10], v.d + v.a * m[3] + v.b * m[7] + v.c * m[11]};
      }
      for (uint32_t k = 0; k < layer.cylinder_count; ++k) {
        layer.cylinders[k].unit = Compose(back, layer.cylinders[k].unit);
      }
      if (layer.has_region != 0) {
        const Region v = layer.region;
        const Point3d p = Map(back, v.min[0], v.min[1], v.min[2]);
        const Point3d q = Map(back, v.max[0], v.max[1], v.max[2]);
        layer.region = {{std::min(p.x, q.x), std::min(p.y, q.y), std::min(p.z, q.z)},
                        {std::max(p.x, q.x), std::max(p.y, q.y), std::max(p.z, q.z)}};
      }
      const OracleClip clip(layer, target);
      for (int64_t v = 0; v < int64_t{grid.nx} * grid.ny * grid.nz; ++v) {
        clip.Has(v % grid.nx, v / grid.nx % grid.ny, v / grid.nx / grid.ny);
        verdicts += layer.plane_count + layer.cylinder_count + 6 * layer.has_region;
      }
      near += clip.near();
    }
    DeltaBuffer delta;
    delta.PutWhole(scene);
    ASSERT_TRUE(engine.SetTarget(target).ok());
    const absl::Status applied = engine.Apply(delta);
    ASSERT_TRUE(applied.ok()) << applied;
    ExpectLikeOracle(engine, scene, target);
    if (HasFatalFailure()) return;
    lit += CountLit(engine.Voxels());
    for (auto& [id, layer] : scene.layers) {
      layer.plane_count = layer.cylinder_count = layer.has_region = 0;
    }
    unclipped += CountLit(OracleVoxels(scene, target).rgb);
  }
  std::cout << lit << " voxels lit, without clips " << unclipped << "; of " << verdicts
            << " verdicts rounding gave " << near << "\n";
  EXPECT_GT(lit, 5000u);
  EXPECT_GT(unclipped, lit + 3000);
  // Most of these are planes through centres: the other verdicts come from the definition itself.
  EXPECT_LT(near * 50, verdicts);
}

// Two layers separated by a plane, one on either side: each voxel is in one of them, and in both
// only if its centre is in the plane.
TEST_P(EngineClip, APlaneAndItsOppositeLeaveNothingOut) {
  const uint64_t seed = SeedOr(7000);
  SceneModel scene;
  for (uint64_t id : {1, 2}) {
    scene.layers[id].id = id;
    scene.layers[id].blend = BlendMode::kAdd;
    scene.geometries[id] =
        SolidBox(id, {24, 24, 16}, {48, 48, 32}, id == 1 ? 0x400000u : 0x000040u);
    scene.drawables[id] = {.id = id, .geometry = id, .layer = id};
  }
  EngineDriver engine = Make();
  std::map<uint32_t, uint64_t> colors;
  for (uint64_t i = 0; i < 8; ++i) {
    SCOPED_TRACE("VOXELD_SEED=" + std::to_string(seed + i));
    SceneGenerator generator(seed + i);
    Affine view;
    for (double& m : view.m) m = generator.Real(-1, 1);
    const double n[3] = {generator.Real(-1, 1), generator.Real(-1, 1), generator.Real(-1, 1)};
    const Point3d at = Map(Inverse(view), generator.Real(8, 40), generator.Real(8, 40), 16);
    const double d = -(n[0] * at.x + n[1] * at.y + n[2] * at.z);
    SetPlanes(scene.layers[1], {{n[0], n[1], n[2], d}});
    SetPlanes(scene.layers[2], {{-n[0], -n[1], -n[2], -d}});
    for (uint64_t id : {1, 2}) scene.layers[id].transform = Inverse(view);
    scene.geometries[1].record.params[3] = scene.geometries[2].record.params[3] = 60;
    scene.geometries[1].record.params[4] = scene.geometries[2].record.params[4] = 60;
    scene.geometries[1].record.params[5] = scene.geometries[2].record.params[5] = 60;
    DeltaBuffer delta;
    delta.PutWhole(scene);
    ASSERT_TRUE(engine.SetTarget(StackTarget(view)).ok());
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectLikeOracle(engine, scene, StackTarget(view));
    if (HasFatalFailure()) return;
    for (uint32_t rgb : engine.Voxels()) ++colors[rgb];
  }
  EXPECT_EQ(colors[0], 0u);
  EXPECT_GT(colors[0x400000], 50000u);
  EXPECT_GT(colors[0x000040], 50000u);
  EXPECT_LT(colors[0x400040], 100u);
}

}  // namespace
}  // namespace voxeld::gpu::conformance
