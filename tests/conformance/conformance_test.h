// The fixture of the conformance suite.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <iostream>
#include <string>
#include <vector>

#include "tests/conformance/engine_cases.h"
#include "tests/conformance/engine_driver.h"
#include "tests/conformance/oracle.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu::conformance {

// Returns a readable description of where an engine's voxels first differ from the required ones;
// empty if nowhere. Voxels that no slice looks at may be 0.
inline std::string FirstDifference(const std::vector<uint32_t>& got, const DenseVolume& want,
                                   const Target& target) {
  const std::vector<uint8_t> seen = OracleSeen(want, target);
  if (got.size() != want.rgb.size()) return "sizes differ";
  for (size_t i = 0; i < got.size(); ++i) {
    if (got[i] == want.rgb[i] || (got[i] == 0 && seen[i] == 0)) continue;
    const size_t nx = static_cast<size_t>(want.nx), ny = static_cast<size_t>(want.ny);
    char text[128];
    std::snprintf(text, sizeof(text), "voxel (%zu, %zu, %zu): got %06X, want %06X", i % nx,
                  i / nx % ny, i / nx / ny, got[i], want.rgb[i]);
    return text;
  }
  return "";
}

// Returns a target of `size` voxels a side, each a pixel of a stack of slices.
inline Target CubeTarget(int32_t size) {
  Target target;
  display::PlanarStack stack;
  stack.width_px = stack.height_px = size;
  for (int32_t i = 0; i < size; ++i) stack.positions_mm.push_back(i);
  target.geometry.shape = stack;
  target.geometry.grid = {size, size, size, {1, 1, 1}, {-size / 2.0, -size / 2.0, -0.5}};
  target.layout = {.slices = size, .width = size, .height = size};
  target.tone.SetCurve(display::Tone::Linear());
  return target;
}

inline ModelGeometry SolidBox(uint64_t id, std::array<float, 3> center, std::array<float, 3> size,
                              uint32_t rgb) {
  ModelGeometry g;
  g.record.id = id;
  g.record.kind = PrimitiveKind::kBox;
  g.record.fill = Fill::kSolid;
  g.record.color = rgb;
  for (size_t a = 0; a < 3; ++a) {
    g.record.params[a] = center[a];
    g.record.params[3 + a] = size[a];
  }
  return g;
}

// Returns a scene with this geometry alone in a layer.
inline SceneModel SceneOf(const ModelGeometry& g, const Affine& transform = Affine()) {
  SceneModel scene;
  scene.layers[1].id = 1;
  scene.geometries[1] = g;
  scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1};
  scene.drawables[1].transform = transform;
  return scene;
}

inline uint64_t CountLit(const std::vector<uint32_t>& voxels) {
  uint64_t lit = 0;
  for (uint32_t rgb : voxels) lit += rgb != 0;
  return lit;
}

class EngineConformance : public testing::TestWithParam<EngineCase> {
 protected:
  EngineDriver Make(EngineOptions options = {.threads = 2}) {
    return EngineDriver(GetParam(), std::move(options));
  }
  // Checks that a scene, drawn whole, equals the oracle's.
  void ExpectLikeOracle(EngineDriver& engine, const SceneModel& scene, const Target& target) {
    const absl::StatusOr<FrameResult> frame = engine.Frame();
    ASSERT_TRUE(frame.ok()) << frame.status();
    const DenseVolume want = OracleVoxels(scene, target);
    const std::vector<uint32_t> voxels = engine.Voxels();
    ASSERT_EQ(FirstDifference(voxels, want, target), "");
    EXPECT_EQ(frame->lit_voxels, CountLit(voxels));
    ASSERT_TRUE(engine.pictures() == OraclePictures(want, target)) << "pictures differ";
  }
  // Returns the target's voxels, drawn whole by a new engine, and checks that the oracle's are the
  // same.
  std::vector<uint32_t> DrawnLikeOracle(const SceneModel& scene, const Target& target) {
    EngineDriver engine = Make();
    DeltaBuffer whole;
    whole.PutWhole(scene);
    EXPECT_TRUE(engine.SetTarget(target).ok());
    const absl::Status applied = engine.Apply(whole);
    EXPECT_TRUE(applied.ok()) << applied;
    ExpectLikeOracle(engine, scene, target);
    return engine.Voxels();
  }
};

}  // namespace voxeld::gpu::conformance
