// Tests many small triangles, which an engine may draw in another way than a few large ones: across
// every edge of volumes that are not multiples of a tile, beside lines, in several layers, and
// while they change.
#include <algorithm>
#include <cmath>
#include <iostream>

#include "display/geometry/footprint.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace mesh_test {

Target StackOf(int32_t width, int32_t height, int32_t slices, display::PixelFormat format) {
  Target target;
  display::PlanarStack stack;
  stack.width_px = width;
  stack.height_px = height;
  for (int32_t s = 0; s < slices; ++s) stack.positions_mm.push_back(s - (slices - 1) * 0.5);
  target.geometry.shape = stack;
  target.geometry.grid = display::DefaultGrid(target.geometry);
  target.layout = {.slices = slices, .width = width, .height = height, .format = format};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

class Meshes : public EngineConformance {
 protected:
  Meshes() { std::cout << "VOXELD_SEED=" << seed_ << "\n"; }

  // Returns triangles of up to `extent` voxels in the grid and around it; some are flat, and some
  // have corners where voxels meet.
  ModelGeometry Mesh(uint64_t id, SurfaceRule rule, uint32_t triangles, double extent,
                     const display::VoxelGrid& grid) {
    ModelGeometry g;
    g.record.id = id;
    g.record.kind = PrimitiveKind::kTriangles;
    g.record.rule = rule;
    g.record.color = static_cast<uint32_t>(random_.Int(1, 0xFFFFFF));
    const double size[3] = {static_cast<double>(grid.nx), static_cast<double>(grid.ny),
                            static_cast<double>(grid.nz)};
    const bool indexed = random_.Chance(0.5), mixed = random_.Chance(0.5);
    for (uint32_t i = 0; i < triangles; ++i) {
      double at[3];
      for (int a = 0; a < 3; ++a) at[a] = random_.Real(-0.2 * size[a], 1.2 * size[a]);
      const bool whole = random_.Chance(0.2), flat = random_.Chance(0.1);
      const double reach = random_.Chance(0.3) ? extent : random_.Real(0, extent);
      for (int corner = 0; corner < 3; ++corner) {
        for (int a = 0; a < 3; ++a) {
          double c = at[a] + random_.Real(-reach / 2, reach / 2);
          if (whole) c = std::round(2 * c) / 2;
          if (corner > 0 && (random_.Chance(0.1) || (flat && a != corner % 2))) {
            c = static_cast<double>(g.positions[g.positions.size() - 3]);
          }
          g.positions.push_back(static_cast<float>(c));
        }
        if (mixed) g.colors.push_back(static_cast<uint32_t>(random_.Int(0, 0xFFFFFF)));
      }
    }
    g.record.vertex_count = triangles * 3;
    if (mixed) g.record.color_mode = ColorMode::kPerVertex;
    if (indexed) {
      for (uint32_t i = 0; i < g.record.vertex_count; ++i) {
        g.indices.push_back(g.record.vertex_count - 1 - i);
      }
      g.record.index_count = g.record.vertex_count;
    }
    return g;
  }

  ModelGeometry Lines(uint64_t id, uint32_t lines, const display::VoxelGrid& grid) {
    ModelGeometry g = Mesh(id, SurfaceRule::kThin, lines * 2, 30, grid);
    g.record.kind = PrimitiveKind::kSegments;
    return g;
  }

  // Returns meshes of both rules in one layer; small ones, and some that are larger than a region.
  SceneModel OneLayer(const display::VoxelGrid& grid, uint32_t triangles) {
    SceneModel scene;
    scene.layers[1].id = 1;
    for (uint64_t id = 1; id <= 4; ++id) {
      const SurfaceRule rule = id % 2 == 0 ? SurfaceRule::kCover : SurfaceRule::kThin;
      const bool large = id > 2;
      scene.geometries[id] =
          Mesh(id, rule, large ? triangles / 8 : triangles, large ? 50 : 8, grid);
      Draw(scene, id, id, 1);
    }
    return scene;
  }

  void Draw(SceneModel& scene, uint64_t id, uint64_t geometry, uint64_t layer) {
    DrawableRecord& d = scene.drawables[id];
    d = {.id = id, .geometry = geometry, .layer = layer};
    d.priority = static_cast<uint32_t>(random_.Int(1, 2));
  }

  DeltaBuffer Whole(const SceneModel& scene) {
    DeltaBuffer delta;
    delta.PutWhole(scene);
    return delta;
  }

  const uint64_t seed_ = SeedOr(7000);
  SceneGenerator random_{seed_};
};

INSTANTIATE_TEST_SUITE_P(Engines, Meshes, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Meshes, OverAllEdgesEqualTheOracle) {
  for (const auto format : {display::PixelFormat::kBitPlanes, display::PixelFormat::kRgb888}) {
    const Target target = StackOf(75, 70, 37, format);
    const SceneModel scene = OneLayer(target.geometry.grid, 400);
    EngineDriver engine = Make();
    ASSERT_TRUE(engine.SetTarget(target).ok());
    ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
    ExpectLikeOracle(engine, scene, target);
  }
}

TEST_P(Meshes, SlicedAnotherWayEqualTheOracle) {
  Target target = StackOf(64, 48, 40, display::PixelFormat::kRgb888);
  target.tone.sampling = display::Sampling::kWeighted;
  const SceneModel scene = OneLayer(target.geometry.grid, 200);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ExpectLikeOracle(engine, scene, target);
}

// One region and one triangle in it, or a thousand: for every way to distribute them.
TEST_P(Meshes, FewAndManyInAPlaceEqualTheOracle) {
  const Target target = StackOf(32, 32, 16, display::PixelFormat::kBitPlanes);
  for (const uint32_t triangles : {1u, 3u, 9u, 40u, 1000u}) {
    for (const SurfaceRule rule : {SurfaceRule::kThin, SurfaceRule::kCover}) {
      SceneModel scene;
      scene.layers[1].id = 1;
      scene.geometries[1] = Mesh(1, rule, triangles, triangles < 10 ? 40 : 4, target.geometry.grid);
      Draw(scene, 1, 1, 1);
      EngineDriver engine = Make();
      ASSERT_TRUE(engine.SetTarget(target).ok());
      ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
      ExpectLikeOracle(engine, scene, target);
    }
  }
}

// More vertices than are examined one by one.
TEST_P(Meshes, LargeOnesWithOneLargeTriangleEqualTheOracle) {
  const Target target = StackOf(100, 40, 30, display::PixelFormat::kBitPlanes);
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.geometries[1] = Mesh(1, SurfaceRule::kThin, 1500, 5, target.geometry.grid);
  scene.geometries[2] = Mesh(2, SurfaceRule::kCover, 1500, 5, target.geometry.grid);
  Draw(scene, 1, 1, 1);
  Draw(scene, 2, 2, 1);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ExpectLikeOracle(engine, scene, target);
  // From one corner of the volume to the other: too large to be drawn in the way of the small ones.
  DeltaBuffer delta;
  for (const uint64_t id : {1, 2}) {
    ModelGeometry& g = scene.geometries[id + 2] = scene.geometries[id];
    g.record.id = id + 2;
    scene.drawables[id].geometry = id + 2;
    const size_t far = g.indices.empty() ? 0 : g.indices[0] * 3;
    const size_t near = g.indices.empty() ? 3 : g.indices[1] * 3;
    for (size_t a = 0; a < 3; ++a) g.positions[far + a] = 200, g.positions[near + a] = -100;
    delta.Put(g);
    delta.Put(scene.drawables[id]);
  }
  ASSERT_TRUE(engine.Apply(delta).ok());
  ExpectLikeOracle(engine, scene, target);
}

// The same triangles under transforms that make them large, small, far away, flat, and small again.
TEST_P(Meshes, MapsDecideWhatIsSmall) {
  const Target target = StackOf(70, 40, 30, display::PixelFormat::kRgb888);
  SceneModel scene = OneLayer(target.geometry.grid, 60);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ExpectLikeOracle(engine, scene, target);
  for (const double scale : {8.0, 0.3, 1.2, 1e6, 0.0, 1.0}) {
    DeltaBuffer delta;
    for (auto& [id, drawable] : scene.drawables) {
      for (int a = 0; a < 3; ++a) {
        drawable.transform.m[a * 5] = a == 1 && scale == 0.3 ? 1.5 : scale;
        drawable.transform.m[a * 4 + 3] = (1 - std::min(scale, 8.0)) * 15;
      }
      delta.Put(drawable);
    }
    ASSERT_TRUE(engine.Apply(delta).ok());
    ASSERT_NO_FATAL_FAILURE(ExpectLikeOracle(engine, scene, target)) << "scale " << scale;
  }
}

// Layers of meshes and lines that mask each other, are clipped, erase and are moved; drawables that
// are inserted, removed and moved in batches.
TEST_P(Meshes, AsTheyChangeInLayersEqualTheOracle) {
  const Target target = StackOf(75, 50, 37, display::PixelFormat::kRgb888);
  const display::VoxelGrid& grid = target.geometry.grid;
  SceneModel scene;
  for (uint64_t layer = 1; layer <= 3; ++layer) scene.layers[layer].id = layer;
  scene.layers[2].blend = BlendMode::kAdd;
  scene.layers[3].opacity = 120;
  scene.layers[3].plane_count = 1;
  scene.layers[3].planes[0] = {1, 0.3, -0.2, -20};
  uint64_t next = 1;
  const auto add = [&](DeltaBuffer* delta) {
    const uint64_t id = next++;
    const SurfaceRule rule = random_.Chance(0.5) ? SurfaceRule::kThin : SurfaceRule::kCover;
    const auto count = static_cast<uint32_t>(random_.Int(0, 60));
    scene.geometries[id] = random_.Chance(0.3)
                               ? Lines(id, count, grid)
                               : Mesh(id, rule, count, random_.Chance(0.2) ? 60 : 9, grid);
    Draw(scene, id, id, static_cast<uint64_t>(random_.Int(1, 3)));
    scene.drawables[id].erase = random_.Chance(0.15);
    if (delta == nullptr) return;
    delta->Put(scene.geometries[id]);
    delta->Put(scene.drawables[id]);
  };
  for (int i = 0; i < 5; ++i) add(nullptr);
  EngineDriver engine = Make();
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(Whole(scene)).ok());
  ExpectLikeOracle(engine, scene, target);
  for (int step = 0; step < 40; ++step) {
    SCOPED_TRACE("step " + std::to_string(step));
    DeltaBuffer delta;
    for (int64_t n = random_.Int(1, 3); n > 0; --n) {
      const int64_t what = random_.Int(0, 5);
      if (what <= 1 || scene.drawables.size() < 3) {
        add(&delta);
      } else if (what == 2) {
        const auto gone = std::next(scene.drawables.begin(), random_.Int(0, 2));
        delta.Drop(Op::kDropDrawable, gone->first);
        scene.drawables.erase(gone);
      } else if (what == 3) {
        DrawableRecord& moved = std::next(scene.drawables.begin(), random_.Int(0, 2))->second;
        moved.transform.m[random_.Int(0, 2) * 4 + 3] += random_.Real(-9, 9);
        delta.Put(moved);
      } else {
        LayerRecord& layer = scene.layers[static_cast<uint64_t>(random_.Int(1, 3))];
        if (what == 4) layer.transform.m[3] = random_.Real(-9, 9);
        if (what == 5) layer.visible = random_.Chance(0.7);
        delta.Put(layer);
      }
    }
    ASSERT_TRUE(engine.Apply(delta).ok());
    ASSERT_NO_FATAL_FAILURE(ExpectLikeOracle(engine, scene, target));
  }
}

}  // namespace mesh_test
}  // namespace voxeld::gpu::conformance
