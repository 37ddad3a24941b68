// Compares FrameResult::memory_bytes with the growth of the process's memory.
#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iostream>
#include <optional>
#include <utility>
#include <vector>

#include "gpu/derived_bytes.h"
#include "tests/conformance/engine_driver.h"
#include "tests/conformance/memory_case.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu::conformance {
namespace {

constexpr int kSize = 64;

uint64_t Allocated() {
  const struct mallinfo2 heap = mallinfo2();
  return uint64_t{heap.uordblks} + heap.hblkhd + DeviceBytes();
}

// Large blocks are aligned to large pages. The allocator counts the address space that it skips for that, which is never used, so
// growth from this size on is measured by resident memory.
constexpr double kLarge = 256 << 20;

uint64_t Resident() {
  std::ifstream file("/proc/self/statm");
  uint64_t pages = 0, resident = 0;
  file >> pages >> resident;
  return resident * static_cast<uint64_t>(sysconf(_SC_PAGESIZE)) + DeviceBytes();
}

// Repeats the scene's drawables, at other places, until there are `count`.
void Multiply(SceneModel& scene, SceneGenerator& chance, size_t count) {
  if (scene.drawables.empty()) return;
  const std::vector<std::pair<uint64_t, DrawableRecord>> first(scene.drawables.begin(),
                                                               scene.drawables.end());
  uint64_t id = first.back().first;
  while (scene.drawables.size() < count) {
    for (const auto& [from, drawable] : first) {
      DrawableRecord copy = drawable;
      copy.id = ++id;
      for (const int at : {3, 7, 11}) copy.transform.m[at] += chance.Real(-kSize, kSize);
      scene.drawables.emplace(copy.id, copy);
    }
  }
}

SceneModel Dots(SceneGenerator& chance, size_t count) {
  SceneModel scene;
  scene.layers[1].id = 1;
  ModelGeometry& dot = scene.geometries[1];
  dot.record.id = 1;
  dot.record.vertex_count = 1;
  dot.positions = {0, 0, 0};
  for (uint64_t id = 1; id <= count; ++id) {
    DrawableRecord& drawable = scene.drawables[id];
    drawable.id = id;
    drawable.geometry = drawable.layer = 1;
    for (const int at : {3, 7, 11}) drawable.transform.m[at] = chance.Real(0, kSize);
  }
  return scene;
}

// Returns a target of 160³ voxels, 1,000 tiles.
Target LargeTarget() {
  constexpr int kEdge = 160;
  Target target;
  display::PlanarStack stack;
  stack.width_px = stack.height_px = kEdge;
  for (int slice = 0; slice < kEdge; ++slice) stack.positions_mm.push_back(slice + 0.5);
  target.geometry.shape = stack;
  target.geometry.grid = {kEdge, kEdge, kEdge, {1, 1, 1}, {}};
  target.layout.slices = target.layout.width = target.layout.height = kEdge;
  return target;
}

ModelGeometry SphereThatFills() {
  ModelGeometry sphere;
  sphere.record.kind = PrimitiveKind::kSphere;
  sphere.record.fill = Fill::kSolid;
  for (float& p : sphere.record.params) p = 400;
  return sphere;
}

// The CPU keeps 256 blocks for tiles that will be lit.
constexpr uint64_t kSpareTiles = 256 * 18 * 1024;

// Returns drawables of one shape that erase, so that nothing is lit, which would take memory too.
SceneModel Erasers(const ModelGeometry& shape, uint64_t count) {
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.geometries[1] = shape;
  scene.geometries[1].record.id = 1;
  for (uint64_t id = 1; id <= count; ++id) {
    DrawableRecord& drawable = scene.drawables[id];
    drawable.id = id;
    drawable.geometry = drawable.layer = 1;
    drawable.erase = 1;
  }
  return scene;
}

class MemoryCount : public ::testing::Test {
 protected:
  // The first scenes that a GPU draws also take memory for its kernels.
  void SetUp() override {
    for (uint64_t seed = 1; seed <= 4; ++seed) {
      SceneGenerator chance(seed);
      const Target target = chance.RandomTarget();
      Draw(target, chance.RandomScene(kSize));
    }
  }

  // Returns: an engine without a scene, instead of the one before.
  EngineDriver& NewEngine() {
    driver_.reset();
    EngineOptions options;
    options.kind = EngineKind::kCpu;
    options.inline_execution = true;
    options.threads = 1;
    options.index_bytes = index_bytes_;
    driver_.emplace(case_.engine, options);
    return *driver_;
  }

  struct Growth {
    double counted = 0, measured = 0;
    double ratio() const { return counted / measured; }
  };
  // Returns: the growth from an empty scene to `scene`, drawn once.
  Growth Draw(const Target& target, const SceneModel& scene) {
    NewEngine();
    EXPECT_TRUE(driver_->SetTarget(target).ok());
    DeltaBuffer nothing;
    nothing.Reset();
    EXPECT_TRUE(driver_->Apply(nothing).ok());
    const uint64_t counted = driver_->Frame()->memory_bytes;
    DeltaBuffer delta;
    delta.PutWhole(scene);
    malloc_trim(0);
    const uint64_t before = Allocated(), resident = Resident();
    EXPECT_TRUE(driver_->Apply(delta).ok());
    const absl::StatusOr<FrameResult> frame = driver_->Frame();
    EXPECT_TRUE(frame.ok()) << frame.status();
    double measured = static_cast<double>(Allocated()) - static_cast<double>(before);
    if (measured >= kLarge) {
      malloc_trim(0);
      measured = static_cast<double>(Resident()) - static_cast<double>(resident);
    }
    return {static_cast<double>(frame->memory_bytes) - static_cast<double>(counted), measured};
  }

  void DrawRandomScenes(uint64_t count);
  void DrawAndRemove(const Target& target, const SceneModel& scene, uint64_t least, uint64_t stays,
                     uint64_t most);
  void DrawAndRemoveDots(uint64_t stays, uint64_t most);
  void DrawLargeShapes(const ModelGeometry& shape, uint64_t count, uint64_t bytes_without_bound);

  const MemoryCase case_ = MeasuredEngine();
  uint64_t index_bytes_ = 0;
  std::optional<EngineDriver> driver_;
};

void MemoryCount::DrawRandomScenes(uint64_t count) {
  const uint64_t seed = SeedOr(1);
  std::vector<double> ratios;
  for (uint64_t i = 0; i < count; ++i) {
    SceneGenerator chance(seed + i);
    const Target target = chance.RandomTarget();
    SceneModel scene = chance.RandomScene(kSize);
    Multiply(scene, chance, case_.drawables);
    if (scene.drawables.empty()) continue;
    const Growth growth = Draw(target, scene);
    ratios.push_back(growth.ratio());
    EXPECT_GE(growth.ratio(), 0.8)
        << "seed " << seed + i << ": " << growth.counted << " of " << growth.measured;
    EXPECT_LE(growth.ratio(), 1.25)
        << "seed " << seed + i << ": " << growth.counted << " of " << growth.measured;
  }
  std::sort(ratios.begin(), ratios.end());
  ASSERT_GT(ratios.size(), count / 2);
  std::cout << ratios.size() << " scenes, counted to measured growth " << ratios.front() << " to "
            << ratios.back() << ", median " << ratios[ratios.size() / 2] << "\n";
}

TEST_F(MemoryCount, ScenesAreCountedAsTheyGrow) { DrawRandomScenes(25); }

TEST_F(MemoryCount, ManyScenesAreCountedAsTheyGrow) { DrawRandomScenes(200); }

TEST_F(MemoryCount, InstancesTakeNoMoreThanWhatIsExpectedOfThem) {
  SceneGenerator chance(SeedOr(1));
  const Target target = chance.RandomTarget();
  const SceneModel scene = Dots(chance, case_.dots);
  const Growth growth = Draw(target, scene);
  EXPECT_GE(growth.ratio(), 0.8);
  EXPECT_LE(growth.ratio(), 1.25);
  EXPECT_LE(growth.measured,
            static_cast<double>(case_.dots * MostDerivedBytes(scene.geometries.at(1).record)));
  const auto dots = static_cast<double>(case_.dots);
  std::cout << growth.measured / dots << " bytes a drawable, counted as " << growth.counted / dots
            << "\n";
}

// Draws a scene, which takes `least` bytes, and removes its drawables, except each `stays`-th (0: none stays, nor do their geometry
// and layer). `most` bytes may be left, beside what the engine keeps.
void MemoryCount::DrawAndRemove(const Target& target, const SceneModel& scene, uint64_t least,
                                uint64_t stays, uint64_t most) {
  NewEngine();
  ASSERT_TRUE(driver_->SetTarget(target).ok());
  ASSERT_TRUE(driver_->Frame().ok());
  const uint64_t before = Allocated();
  {
    DeltaBuffer delta;
    delta.PutWhole(scene);
    ASSERT_TRUE(driver_->Apply(delta).ok());
    ASSERT_TRUE(driver_->Frame().ok());
    ASSERT_GT(Allocated(), before + least);
    DeltaBuffer drops;
    for (const auto& [id, drawable] : scene.drawables) {
      if (stays == 0 || id % stays != 0) drops.Drop(Op::kDropDrawable, id);
    }
    if (stays == 0) {
      for (const auto& [id, geometry] : scene.geometries) drops.Drop(Op::kDropGeometry, id);
      for (const auto& [id, layer] : scene.layers) drops.Drop(Op::kDropLayer, id);
    }
    ASSERT_TRUE(driver_->Apply(drops).ok());
    ASSERT_TRUE(driver_->Frame().ok());
  }
  EXPECT_LT(Allocated(), before + most + case_.kept_bytes);
}

void MemoryCount::DrawAndRemoveDots(uint64_t stays, uint64_t most) {
  SceneGenerator chance(SeedOr(1));
  const Target target = chance.RandomTarget();
  DrawAndRemove(target, Dots(chance, case_.dots), 60 << 20, stays, most);
}

TEST_F(MemoryCount, WhatGoesIsGivenBack) { DrawAndRemoveDots(0, 3 << 20); }

TEST_F(MemoryCount, MemoryIsGivenBackWhileOthersStay) { DrawAndRemoveDots(1000, 6 << 20); }

TEST_F(MemoryCount, ListsOfTilesAreGivenBack) {
  DrawAndRemove(LargeTarget(), Erasers(SphereThatFills(), 600), 9 << 20, 0,
                kSpareTiles + (1 << 20));
}

// Drawables that fill the volume, as many as would take several times what is allowed for lists and items.
void MemoryCount::DrawLargeShapes(const ModelGeometry& shape, uint64_t count,
                                  uint64_t bytes_without_bound) {
  constexpr uint64_t kBytes = 1 << 20;
  index_bytes_ = kBytes;
  const Growth growth = Draw(LargeTarget(), Erasers(shape, count));
  const uint64_t bound =
      count * MostDerivedBytes(shape.record) + kBytes / 4 * 5 + kSpareTiles + (1 << 20);
  ASSERT_GT(bytes_without_bound, 2 * bound);
  EXPECT_LE(growth.measured, static_cast<double>(bound));
}

TEST_F(MemoryCount, ListsOfLargeShapesStayWithinTheirBound) {
  constexpr uint64_t kCount = 600;
  constexpr uint64_t kTiles = 10 * 10 * 10;
  DrawLargeShapes(SphereThatFills(), kCount, kCount * kTiles * 32);
}

TEST_F(MemoryCount, InteriorsOfFilledMeshesStayWithinTheirBound) {
  ModelGeometry mesh;
  mesh.record.kind = PrimitiveKind::kFilled;
  mesh.record.vertex_count = 4;
  mesh.record.index_count = 12;
  mesh.positions = {0, 0, 0, 190, 0, 0, 0, 160, 0, 0, 0, 120};
  mesh.indices = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  constexpr uint64_t kCount = 100;
  DrawLargeShapes(mesh, kCount, kCount * 160 * 160 * 120 / 8);
}

}  // namespace
}  // namespace voxeld::gpu::conformance
