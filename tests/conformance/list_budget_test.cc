// Tests scenes whose lists, by region and by tile, need more memory than the CUDA engine may take.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <ostream>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "display/geometry/footprint.h"
#include "gpu/cuda/cuda_engine.h"
#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

// Blocks of regions are 128×128×64 voxels.
Target StackOf(int32_t width, int32_t height, int32_t slices) {
  Target target;
  display::PlanarStack stack;
  stack.width_px = width;
  stack.height_px = height;
  for (int32_t s = 0; s < slices; ++s) stack.positions_mm.push_back(s - (slices - 1) * 0.5);
  target.geometry.shape = stack;
  target.geometry.grid = display::DefaultGrid(target.geometry);
  target.layout = {.slices = slices,
                   .width = width,
                   .height = height,
                   .format = display::PixelFormat::kBitPlanes};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

// Inserts lines of one or two colours each, some of them beyond the volume.
void PutLines(SceneModel& scene, uint64_t id, uint64_t layer, uint32_t lines, float length,
              const display::VoxelGrid& grid) {
  std::mt19937_64 random(id);
  scene.layers[layer].id = layer;
  scene.layers[layer].order = static_cast<int32_t>(layer);
  ModelGeometry& g = scene.geometries[id];
  g.record.id = id;
  g.record.kind = PrimitiveKind::kSegments;
  g.record.color_mode = ColorMode::kPerVertex;
  const float size[3] = {static_cast<float>(grid.nx), static_cast<float>(grid.ny),
                         static_cast<float>(grid.nz)};
  std::uniform_real_distribution<float> step(-length, length);
  for (uint32_t i = 0; i < lines; ++i) {
    float at[3];
    for (int a = 0; a < 3; ++a) {
      at[a] = std::uniform_real_distribution<float>(-0.1F * size[a], 1.1F * size[a])(random);
      g.positions.push_back(at[a]);
    }
    for (const float s : at) g.positions.push_back(s + step(random));
    g.colors.push_back(static_cast<uint32_t>(random() & 0xFFFFFF));
    g.colors.push_back(i % 2 == 0 ? g.colors.back() : static_cast<uint32_t>(random() & 0xFFFFFF));
  }
  g.record.vertex_count = 2 * lines;
  scene.drawables[id] = {.id = id, .geometry = id, .layer = layer, .priority = 1};
}

// Inserts triangles of one or two colours each, less than `extent` wide.
void PutTriangles(SceneModel& scene, uint64_t id, uint64_t layer, uint32_t triangles, float extent,
                  const display::VoxelGrid& grid) {
  // A line followed to and fro is a triangle with a third corner.
  PutLines(scene, id, layer, triangles, extent / 2, grid);
  ModelGeometry& g = scene.geometries[id];
  std::mt19937_64 random(id);
  std::uniform_real_distribution<float> step(-extent / 2, extent / 2);
  g.record.kind = PrimitiveKind::kTriangles;
  std::vector<float> positions;
  std::vector<uint32_t> colors;
  for (size_t i = 0; i < triangles; ++i) {
    const float* const line = &g.positions[i * 6];
    positions.insert(positions.end(), line, line + 6);
    for (int a = 0; a < 3; ++a) positions.push_back(line[a] + step(random));
    colors.insert(colors.end(), {g.colors[2 * i], g.colors[2 * i], g.colors[2 * i + 1]});
  }
  g.positions = std::move(positions);
  g.colors = std::move(colors);
  g.record.vertex_count = 3 * triangles;
}

// Inserts the end points of such lines.
void PutPoints(SceneModel& scene, uint64_t id, uint64_t layer, uint32_t points,
               const display::VoxelGrid& grid) {
  PutLines(scene, id, layer, points / 2, 20, grid);
  scene.geometries[id].record.kind = PrimitiveKind::kPoints;
}

// Inserts thick lines: they are listed in pairs with the tiles that they touch.
void PutCapsules(SceneModel& scene, uint64_t id, uint64_t layer, uint32_t lines, float length,
                 const display::VoxelGrid& grid) {
  PutLines(scene, id, layer, lines, length, grid);
  scene.geometries[id].record.thickness = 3;
}

void PutBall(SceneModel& scene, uint64_t id, uint64_t layer, float x, float y, float z,
             float radius) {
  scene.layers[layer].id = layer;
  scene.layers[layer].order = static_cast<int32_t>(layer);
  ModelGeometry& g = scene.geometries[id];
  g.record.id = id;
  g.record.kind = PrimitiveKind::kSphere;
  g.record.color = 0x2040FFu + static_cast<uint32_t>(id);
  const float params[4] = {x, y, z, radius};
  for (int i = 0; i < 4; ++i) g.record.params[i] = params[i];
  scene.drawables[id] = {.id = id, .geometry = id, .layer = layer, .priority = 1};
}

EngineCase CaseWith(const cuda::Tuning& tuning, const cuda::FaultPlan& faults = {}) {
  return {"cuda", [=](const EngineOptions& options) {
            return CreateCudaEngine(options, "a test", faults, tuning);
          }};
}

// The expected result of a scene.
struct Drawn {
  DeltaBuffer delta;
  DenseVolume voxels;
  std::vector<std::byte> pictures;

  Drawn(const SceneModel& scene, const Target& target)
      : voxels(OracleVoxels(scene, target)), pictures(OraclePictures(voxels, target)) {
    delta.PutWhole(scene);
  }
};

void ExpectDrawn(EngineDriver& engine, const SceneModel& scene, const Target& target) {
  const Drawn want(scene, target);
  const absl::StatusOr<FrameResult> frame = engine.Frame();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_TRUE(engine.pictures() == want.pictures);
  EXPECT_EQ(FirstDifference(engine.Voxels(), want.voxels, target), "");
}

constexpr uint64_t kPlenty = uint64_t{1} << 30;

// Items that are put into a scene of two layers and drawn under several budgets.
struct Kind {
  const char* name;
  void (*put)(SceneModel& scene, const display::VoxelGrid& grid);
  int32_t slices;
  std::vector<uint64_t> budgets;
  uint64_t lists;      // whose bytes are more than all budgets, and more than this
  uint32_t for_lists;  // calls that take memory for them, of few
};
void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

const Kind kKinds[] = {
    {"lines",
     [](SceneModel& scene, const display::VoxelGrid& grid) {
       PutLines(scene, 1, 1, 20'000, 60, grid);
       PutLines(scene, 2, 2, 4'000, 300, grid);
     },
     200,
     {1, 200'000, 400'000, 1'000'000, 3'000'000},
     3'000'000,
     7},
    {"points",
     [](SceneModel& scene, const display::VoxelGrid& grid) {
       PutPoints(scene, 1, 1, 20'000, grid);
       PutPoints(scene, 2, 2, 4'000, grid);
     },
     200,
     {1, 20'000, 60'000, 110'000, 150'000},
     150'000,
     4},
    {"triangles",
     [](SceneModel& scene, const display::VoxelGrid& grid) {
       PutTriangles(scene, 1, 1, 4'000, 50, grid);
       PutTriangles(scene, 2, 2, 4'000, 20, grid);
     },
     200,
     {1, 15'000, 40'000, 60'000, 90'000},
     90'000,
     3},
    {"pairs",
     [](SceneModel& scene, const display::VoxelGrid& grid) {
       PutCapsules(scene, 1, 1, 1'000, 40, grid);
       PutTriangles(scene, 2, 2, 20, 400, grid);
       PutBall(scene, 3, 2, 70, 60, 60, 40);
     },
     100,
     {1, 20'000, 50'000, 100'000, 150'000},
     150'000,
     7},
    {"all",
     [](SceneModel& scene, const display::VoxelGrid& grid) {
       PutLines(scene, 1, 1, 2'000, 60, grid);
       PutTriangles(scene, 2, 2, 2'000, 30, grid);
       PutCapsules(scene, 3, 2, 200, 30, grid);
       PutBall(scene, 4, 1, 70, 60, 60, 40);
       PutPoints(scene, 5, 2, 4'000, grid);
     },
     100,
     {1, 50'000, 100'000, 300'000},
     300'000,
     7},
};

// The part of a budget that may be kept.
constexpr double kShares[] = {0.0, 0.5};

class ListBudgetOf : public testing::TestWithParam<Kind> {
 protected:
  SceneModel SceneOn(const Target& target) const {
    SceneModel scene;
    GetParam().put(scene, target.geometry.grid);
    scene.layers[2].opacity = 180;
    scene.layers[2].blend = BlendMode::kAdd;
    return scene;
  }
};

TEST_P(ListBudgetOf, WhateverItIsTheSameIsDrawnAndNoMoreMemoryTaken) {
  const Target target = StackOf(150, 140, GetParam().slices);
  const Drawn want(SceneOn(target), target);
  std::vector<uint64_t> budgets = GetParam().budgets;
  budgets.push_back(kPlenty);
  uint64_t without_lists = 0;
  for (const uint64_t bytes : budgets) {
    for (const double kept : kShares) {
      SCOPED_TRACE(std::to_string(bytes) + " bytes, to be kept " + std::to_string(kept));
      EngineDriver engine(CaseWith({.index_bytes = bytes, .index_share_kept = kept}),
                          {.threads = 1});
      ASSERT_TRUE(engine.SetTarget(target).ok());
      ASSERT_TRUE(engine.Apply(want.delta).ok());
      const absl::StatusOr<FrameResult> frame = engine.Frame();
      ASSERT_TRUE(frame.ok()) << frame.status();
      EXPECT_TRUE(engine.pictures() == want.pictures);
      EXPECT_EQ(FirstDifference(engine.Voxels(), want.voxels, target), "");
      if (bytes == 1 && kept == kShares[0]) without_lists = frame->memory_bytes;
      if (bytes == kPlenty) {
        EXPECT_GT(frame->memory_bytes, without_lists + GetParam().lists)
            << "the lists need no more";
      } else {
        EXPECT_LE(frame->memory_bytes, without_lists + bytes);
      }
    }
  }
}

// The lists of some stay and those of others do not fit; then they have room.
TEST(ListBudget, SomeLinesWithinItAndSomeNot) {
  const Target target = StackOf(70, 60, 150);
  SceneModel scene;
  PutLines(scene, 1, 1, 3'000, 10, target.geometry.grid);
  EngineDriver engine(CaseWith({.few_items = 0, .index_bytes = 500'000}), {.threads = 1});
  ASSERT_TRUE(engine.SetTarget(target).ok());
  const auto expect = [&](const std::string& what) {
    SCOPED_TRACE(what);
    ExpectDrawn(engine, scene, target);
  };
  DeltaBuffer first;
  first.PutWhole(scene);
  ASSERT_TRUE(engine.Apply(first).ok());
  expect("a little");

  PutLines(scene, 2, 1, 30'000, 20, target.geometry.grid);
  PutLines(scene, 3, 2, 500, 20, target.geometry.grid);
  PutLines(scene, 4, 3, 6'000, 10, target.geometry.grid);
  DeltaBuffer more;
  for (const uint64_t id : {2, 3, 4}) more.Put(scene.geometries[id]);
  for (const uint64_t id : {2, 3}) more.Put(scene.layers[id]);
  for (const uint64_t id : {2, 3, 4}) more.Put(scene.drawables[id]);
  ASSERT_TRUE(engine.Apply(more).ok());
  expect("with more in the same layer, and others");

  scene.layers[3].visible = 0;
  scene.drawables[2].transform.m[3] = 7;
  DeltaBuffer moved;
  moved.Put(scene.layers[3]);
  moved.Put(scene.drawables[2]);
  ASSERT_TRUE(engine.Apply(moved).ok());
  expect("a layer hidden, the most of the lines moved");

  scene.layers[3].visible = 1;
  for (const uint64_t id : {1, 2}) scene.drawables.erase(id);
  DeltaBuffer less;
  less.Put(scene.layers[3]);
  for (const uint64_t id : {1, 2}) less.Drop(Op::kDropDrawable, id);
  ASSERT_TRUE(engine.Apply(less).ok());
  expect("without the most of the lines");
  scene.drawables.erase(3);
  DeltaBuffer last;
  last.Drop(Op::kDropDrawable, 3);
  ASSERT_TRUE(engine.Apply(last).ok());
  expect("without those in front");
}

// Points whose lists do not fit are removed, one drawable after the other, until the lists fit.
TEST(ListBudget, PointsThatLeaveUntilTheyFit) {
  const Target target = StackOf(70, 60, 100);
  SceneModel scene;
  constexpr uint64_t kClouds = 5;
  for (uint64_t id = 1; id <= kClouds; ++id) {
    PutPoints(scene, id, 1 + id % 2, 2'000, target.geometry.grid);
  }
  for (const uint32_t each : {1u, 4u, 16u}) {
    SCOPED_TRACE(std::to_string(each) + " a thread");
    SceneModel left = scene;
    EngineDriver engine(CaseWith({.few_items = 0, .points_each = each, .index_bytes = 80'000}),
                        {.threads = 1});
    ASSERT_TRUE(engine.SetTarget(target).ok());
    DeltaBuffer delta;
    delta.PutWhole(left);
    for (uint64_t id = kClouds;; --id) {
      SCOPED_TRACE(std::to_string(id) + " clouds");
      ASSERT_TRUE(engine.Apply(delta).ok());
      ExpectDrawn(engine, left, target);
      if (id == 0) break;
      left.drawables.erase(id);
      delta = {};
      delta.Drop(Op::kDropDrawable, id);
    }
  }
}

// There they are drawn with the thin lines.
TEST(ListBudget, PointsInMoreRegionsThanCanBeSorted) {
  const Target target = StackOf(16'384, 1, 833);  // 114,688
  SceneModel scene;
  PutPoints(scene, 1, 1, 3'000, target.geometry.grid);
  const Drawn want(scene, target);
  EngineDriver engine(CaseWith({}), {.threads = 1});
  ASSERT_TRUE(engine.SetTarget(target).ok());
  ASSERT_TRUE(engine.Apply(want.delta).ok());
  const absl::StatusOr<FrameResult> frame = engine.Frame();
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_GT(frame->lit_voxels, 0u);
  EXPECT_TRUE(engine.pictures() == want.pictures);
}

TEST(ListBudget, SomeTrianglesAndPairsWithinItAndSomeNot) {
  const Target target = StackOf(70, 60, 150);
  const display::VoxelGrid& grid = target.geometry.grid;
  SceneModel scene;
  PutTriangles(scene, 1, 1, 300, 10, grid);
  PutCapsules(scene, 2, 1, 40, 10, grid);
  EngineDriver engine(CaseWith({.few_items = 0, .index_bytes = 120'000}), {.threads = 1});
  ASSERT_TRUE(engine.SetTarget(target).ok());
  const auto expect = [&](const std::string& what, const DeltaBuffer& delta) {
    SCOPED_TRACE(what);
    ASSERT_TRUE(engine.Apply(delta).ok());
    ExpectDrawn(engine, scene, target);
  };
  DeltaBuffer first;
  first.PutWhole(scene);
  expect("a little", first);

  PutTriangles(scene, 3, 1, 6'000, 12, grid);
  PutTriangles(scene, 4, 2, 2'000, 12, grid);
  PutCapsules(scene, 5, 1, 1'500, 6, grid);  // more than one batch takes
  PutCapsules(scene, 6, 3, 60, 40, grid);
  for (uint64_t id = 10; id < 40; ++id) {
    const auto at = static_cast<float>(id);
    PutBall(scene, id, 2 + id % 2, at * 1.5F, 60 - at, at * 3, 6);
  }
  DeltaBuffer more;
  for (const auto& [id, geometry] : scene.geometries) {
    if (id > 2) more.Put(geometry);
  }
  for (const uint64_t id : {2, 3}) more.Put(scene.layers[id]);
  for (const auto& [id, drawable] : scene.drawables) {
    if (id > 2) more.Put(drawable);
  }
  expect("with more in the same layer, and others", more);

  scene.layers[3].visible = 0;
  for (const uint64_t id : {3, 5, 10}) scene.drawables[id].transform.m[3] = 7;
  DeltaBuffer moved;
  moved.Put(scene.layers[3]);
  for (const uint64_t id : {3, 5, 10}) moved.Put(scene.drawables[id]);
  expect("a layer hidden, the most moved", moved);

  scene.layers[3].visible = 1;
  DeltaBuffer less;
  less.Put(scene.layers[3]);
  for (const uint64_t id : {1, 3, 5, 12}) {
    scene.drawables.erase(id);
    less.Drop(Op::kDropDrawable, id);
  }
  expect("without the most of it", less);
  DeltaBuffer last;
  for (const uint64_t id : {2, 4, 6, 13}) {
    scene.drawables.erase(id);
    last.Drop(Op::kDropDrawable, id);
  }
  expect("of balls alone", last);
  PutTriangles(scene, 50, 1, 300, 10, grid);
  DeltaBuffer fresh;
  fresh.Put(scene.geometries[50]);
  fresh.Put(scene.drawables[50]);
  expect("with some triangles again", fresh);
}

// Without room to remove old entries from the index of pairs, it is rebuilt.
TEST(ListBudget, WhatHasGoneLeavesItsRoom) {
  const Target target = StackOf(40, 30, 70);
  const display::VoxelGrid& grid = target.geometry.grid;
  constexpr uint32_t kCloud = 70'000;  // more than may be removed without cleaning up
  SceneModel scene;
  PutCapsules(scene, 1, 1, 30, 8, grid);
  PutCapsules(scene, 2, 2, kCloud, 2, grid);
  scene.layers[2].visible = 0;  // costs pairs, but no drawing
  EngineDriver engine(CaseWith({.few_items = 0, .index_bytes = 6'000'000, .index_share_kept = 0.9}),
                      {.threads = 1});
  ASSERT_TRUE(engine.SetTarget(target).ok());
  DeltaBuffer delta;
  delta.PutWhole(scene);
  uint64_t greatest = 0;
  for (uint64_t round = 0; round < 4; ++round) {
    SCOPED_TRACE("round " + std::to_string(round));
    ASSERT_TRUE(engine.Apply(delta).ok());
    const Drawn want(scene, target);
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_TRUE(engine.pictures() == want.pictures);
    EXPECT_EQ(FirstDifference(engine.Voxels(), want.voxels, target), "");
    if (round == 0) {
      greatest = frame->memory_bytes;
      EXPECT_GT(greatest, 4'000'000u) << "the cloud needs no pairs";
    }
    EXPECT_LE(frame->memory_bytes, greatest + 8'000'000);
    // Another cloud in place of this one, and something visible.
    const uint64_t cloud = round == 0 ? 2 : 100 + round - 1, ball = 200 + round;
    scene.drawables.erase(cloud);
    scene.geometries.erase(cloud);
    PutCapsules(scene, 100 + round, 2, kCloud, 2, grid);
    scene.layers[2].visible = 0;
    PutBall(scene, ball, 1, 10 + 5 * static_cast<float>(round), 15, 30, 5);
    delta = {};
    delta.Drop(Op::kDropDrawable, cloud);
    delta.Drop(Op::kDropGeometry, cloud);
    for (const uint64_t id : {100 + round, ball}) {
      delta.Put(scene.geometries[id]);
      delta.Put(scene.drawables[id]);
    }
  }
}

// The target, the scene and a frame, each repeated if it is refused.
struct Played {
  uint32_t refused = 0, lost = 0;
  bool as_wanted = false;
};
Played Play(const Target& target, const Drawn& want, const cuda::FaultPlan& faults) {
  Played played;
  EngineDriver engine(CaseWith({}, faults), {.threads = 1});
  const auto twice = [&](const std::function<absl::Status()>& call) {
    absl::Status status = call();
    if (absl::IsResourceExhausted(status)) {
      ++played.refused;
      status = call();
    }
    if (!status.ok()) ++played.lost;
  };
  twice([&] { return engine.SetTarget(target); });
  twice([&] { return engine.Apply(want.delta); });
  twice([&] { return engine.Frame().status(); });
  played.as_wanted = engine.pictures() == want.pictures;
  return played;
}

// Each CUDA call in turn finds no memory, once. If that memory was for a list, or for building one,
// nothing is refused.
TEST_P(ListBudgetOf, ADeviceWithoutMemoryForListsRefusesNothing) {
  const Target target = StackOf(40, 30, 20);
  SceneModel scene = SceneOn(target);
  // Keeps a few of each.
  for (auto& [id, g] : scene.geometries) {
    if (g.positions.empty()) continue;
    constexpr uint32_t kVertices = 120;
    g.record.vertex_count = std::min(g.record.vertex_count, kVertices);
    g.positions.resize(size_t{g.record.vertex_count} * 3);
    g.colors.resize(g.record.vertex_count);
  }
  const Drawn want(scene, target);
  uint32_t refused = 0, drawn = 0;
  for (uint64_t call = 1; Play(target, want, {call, cudaErrorIllegalAddress, false}).lost != 0;
       ++call) {
    SCOPED_TRACE("call " + std::to_string(call));
    ASSERT_LT(call, 1000u);
    const Played played = Play(target, want, {call, cudaErrorMemoryAllocation, false});
    EXPECT_TRUE(played.as_wanted);
    EXPECT_EQ(played.lost, 0u);
    EXPECT_LE(played.refused, 1u);
    ++(played.refused != 0 ? refused : drawn);
  }
  EXPECT_GT(refused, 0u);
  EXPECT_GE(drawn, GetParam().for_lists);
}

INSTANTIATE_TEST_SUITE_P(Kinds, ListBudgetOf, testing::ValuesIn(kKinds),
                         [](const auto& kind) { return std::string(kind.param.name); });

}  // namespace
}  // namespace voxeld::gpu::conformance
