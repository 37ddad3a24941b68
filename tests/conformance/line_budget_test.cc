// Thin lines for whose lists by region the CUDA engine may not take enough memory.
#include <gtest/gtest.h>

#include <functional>
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
                   .format = display::PixelFormat::kBitPlanes3};
  for (size_t c = 0; c < 256; ++c) target.tone.lut[c] = static_cast<uint16_t>(c * 257);
  return target;
}

// Of one or two colours each, here and there beyond the volume.
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

EngineCase CaseWith(const cuda::Tuning& tuning, const cuda::FaultPlan& faults = {}) {
  return {"cuda", [=](const EngineOptions& options) {
            return CreateCudaEngine(options, "a test", faults, tuning);
          }};
}

// A scene as it should be drawn.
struct Drawn {
  DeltaBuffer delta;
  DenseVolume voxels;
  std::vector<std::byte> pictures;

  Drawn(const SceneModel& scene, const Target& target)
      : voxels(OracleVoxels(scene, target)), pictures(OraclePictures(voxels, target)) {
    delta.PutWhole(scene);
  }
};

constexpr uint64_t kPlenty = uint64_t{1} << 30;

TEST(LineBudget, WhateverItIsTheSameIsDrawnAndNoMoreMemoryTaken) {
  const Target target = StackOf(150, 140, 200);
  SceneModel scene;
  PutLines(scene, 1, 1, 20'000, 60, target.geometry.grid);
  PutLines(scene, 2, 2, 4'000, 300, target.geometry.grid);
  scene.layers[2].opacity = 180;
  scene.layers[2].blend = BlendMode::kAdd;
  const Drawn want(scene, target);
  uint64_t without_lists = 0;
  for (const uint64_t bytes : {uint64_t{1}, uint64_t{200'000}, uint64_t{400'000},
                               uint64_t{1'000'000}, uint64_t{3'000'000}, kPlenty}) {
    for (const double kept : {0.0, 0.5}) {
      SCOPED_TRACE(std::to_string(bytes) + " bytes, to be kept " + std::to_string(kept));
      EngineDriver engine(CaseWith({.index_bytes = bytes, .index_share_kept = kept}),
                          {.threads = 1});
      ASSERT_TRUE(engine.SetTarget(target).ok());
      ASSERT_TRUE(engine.Apply(want.delta).ok());
      const absl::StatusOr<FrameResult> frame = engine.Frame();
      ASSERT_TRUE(frame.ok()) << frame.status();
      EXPECT_TRUE(engine.pictures() == want.pictures);
      EXPECT_EQ(FirstDifference(engine.Voxels(), want.voxels, target), "");
      if (bytes == 1 && kept == 0) without_lists = frame->memory_bytes;
      if (bytes == kPlenty) {
        EXPECT_GT(frame->memory_bytes, without_lists + 3'000'000) << "the lists need no more";
      } else {
        EXPECT_LE(frame->memory_bytes, without_lists + bytes);
      }
    }
  }
}

// Lists of some lines stay, others' do not fit; then they have room.
TEST(LineBudget, SomeLinesWithinItAndSomeNot) {
  const Target target = StackOf(70, 60, 150);
  SceneModel scene;
  PutLines(scene, 1, 1, 3'000, 10, target.geometry.grid);
  EngineDriver engine(CaseWith({.few_items = 0, .index_bytes = 500'000}), {.threads = 1});
  ASSERT_TRUE(engine.SetTarget(target).ok());
  const auto expect = [&](const std::string& what) {
    SCOPED_TRACE(what);
    const Drawn want(scene, target);
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok()) << frame.status();
    EXPECT_TRUE(engine.pictures() == want.pictures);
    EXPECT_EQ(FirstDifference(engine.Voxels(), want.voxels, target), "");
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

// The target, the scene and a frame, each made again if it is refused.
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

// Each call of CUDA in its turn finds no memory, once. Where that was to be had for a list, or was for
// its making, nothing is refused.
TEST(LineBudget, ADeviceWithoutMemoryForListsRefusesNothing) {
  const Target target = StackOf(40, 30, 20);
  SceneModel scene;
  PutLines(scene, 1, 1, 300, 20, target.geometry.grid);
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
  constexpr uint32_t kForLists = 7;  // blocks, and as many kernels and more
  EXPECT_GE(drawn, kForLists);
}

}  // namespace
}  // namespace voxeld::gpu::conformance
