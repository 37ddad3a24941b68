// Compares the voxels inside meshes with counts that are known or computed without them. Random
// meshes are among the random scenes.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace {

constexpr int32_t kSize = 60;

class FilledMeshes : public EngineConformance {
 protected:
  std::vector<uint32_t> Draw(const ModelGeometry& mesh, const Affine& transform = {}) {
    SceneModel scene;
    scene.layers[1].id = 1;
    scene.geometries[1] = mesh;
    scene.geometries[1].record.id = 1;
    scene.drawables[1] = {.id = 1, .geometry = 1, .layer = 1, .transform = transform};
    DeltaBuffer delta;
    delta.PutWhole(scene);
    EngineDriver engine = Make({.threads = 2});
    EXPECT_TRUE(engine.SetTarget(CubeTarget(kSize)).ok());
    EXPECT_TRUE(engine.Apply(delta).ok());
    EXPECT_TRUE(engine.Frame().ok());
    return engine.Voxels();
  }

  static size_t At(int x, int y, int z) {
    return (static_cast<size_t>(z) * kSize + static_cast<size_t>(y)) * kSize +
           static_cast<size_t>(x);
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, FilledMeshes, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

void AddVertex(ModelGeometry& mesh, double x, double y, double z) {
  for (const double p : {x, y, z}) mesh.positions.push_back(static_cast<float>(p));
  mesh.record.vertex_count = static_cast<uint32_t>(mesh.positions.size() / 3);
}

void AddFaces(ModelGeometry& mesh, const std::vector<uint32_t>& corners) {
  mesh.indices.insert(mesh.indices.end(), corners.begin(), corners.end());
  mesh.record.index_count = static_cast<uint32_t>(mesh.indices.size());
}

void AddCube(ModelGeometry& mesh, double lo, double hi) {
  const uint32_t first = mesh.record.vertex_count;
  for (int corner = 0; corner < 8; ++corner) {
    AddVertex(mesh, corner & 1 ? hi : lo, corner & 2 ? hi : lo, corner & 4 ? hi : lo);
  }
  constexpr uint32_t kSides[6][4] = {{0, 1, 3, 2}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                     {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}};
  for (const auto& s : kSides) {
    AddFaces(mesh,
             {first + s[0], first + s[1], first + s[2], first + s[0], first + s[2], first + s[3]});
  }
}

ModelGeometry Filled() {
  ModelGeometry mesh;
  mesh.record.kind = PrimitiveKind::kFilled;
  mesh.record.color = 0x123456;
  return mesh;
}

// Returns a ball: bands from pole to pole, with every second triangle reversed.
ModelGeometry Ball(double radius, double middle) {
  constexpr uint32_t kBands = 90, kAround = 180;
  ModelGeometry mesh = Filled();
  for (uint32_t band = 0; band <= kBands; ++band) {
    const double polar = std::numbers::pi * band / kBands;
    for (uint32_t i = 0; i < kAround; ++i) {
      const double turn = 2 * std::numbers::pi * i / kAround;
      const double beside = band % kBands == 0 ? 0 : radius * std::sin(polar);
      AddVertex(mesh, middle + beside * std::cos(turn), middle + beside * std::sin(turn),
                middle + radius * std::cos(polar));
    }
  }
  for (uint32_t band = 0; band < kBands; ++band) {
    for (uint32_t i = 0; i < kAround; ++i) {
      const uint32_t a = band * kAround + i, b = band * kAround + (i + 1) % kAround;
      AddFaces(mesh, {a, b, b + kAround, a, a + kAround, b + kAround});
    }
  }
  return mesh;
}

TEST_P(FilledMeshes, ABallHasItsVolumeAndIsWhereItIs) {
  constexpr double kRadius = 20, kMiddle = 30.3;
  const std::vector<uint32_t> voxels = Draw(Ball(kRadius, kMiddle));
  const double volume = 4.0 / 3 * std::numbers::pi * kRadius * kRadius * kRadius;
  EXPECT_NEAR(static_cast<double>(CountLit(voxels)), volume, 0.01 * volume);
  // Its facets lie up to 0.02 voxels below the ball's surface; snapping moves corners by less than
  // 0.01.
  for (int z = 0; z < kSize; ++z) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const double r = std::hypot(x + 0.5 - kMiddle, y + 0.5 - kMiddle, z + 0.5 - kMiddle);
        const uint32_t rgb = voxels[At(x, y, z)];
        const uint32_t want = r < kRadius ? 0x123456 : 0;
        if (r < kRadius - 0.03 || r > kRadius + 0.01) {
          ASSERT_EQ(rgb, want) << x << " " << y << " " << z;
        }
      }
    }
  }
}

TEST_P(FilledMeshes, AShiftByWholeVoxelsShiftsWhatIsFilled) {
  const ModelGeometry ball = Ball(11.7, 20.21);
  const std::vector<uint32_t> voxels = Draw(ball);
  const std::vector<uint32_t> moved = Draw(ball, {{1, 0, 0, 17, 0, 1, 0, 3, 0, 0, 1, 21}});
  uint64_t lit = 0;
  for (int z = 0; z < kSize - 21; ++z) {
    for (int y = 0; y < kSize - 3; ++y) {
      for (int x = 0; x < kSize - 17; ++x) {
        ASSERT_EQ(moved[At(x + 17, y + 3, z + 21)], voxels[At(x, y, z)]);
        lit += voxels[At(x, y, z)] != 0 ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(lit, CountLit(voxels));
  EXPECT_EQ(lit, CountLit(moved));
}

TEST_P(FilledMeshes, FacesThroughCentresOfVoxelsHaveThemOnOneSide) {
  ModelGeometry cube = Filled();
  AddCube(cube, 4.5, 24.5);
  const std::vector<uint32_t> voxels = Draw(cube);
  for (int z = 0; z < kSize; ++z) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const bool inside = std::min({x, y, z}) >= 4 && std::max({x, y, z}) < 24;
        ASSERT_EQ(voxels[At(x, y, z)] != 0, inside) << x << " " << y << " " << z;
      }
    }
  }
}

TEST_P(FilledMeshes, WhatIsInTheOtherIsHollowAndWhatIsOutsideOfTheVolumeCounts) {
  ModelGeometry mesh = Filled();
  AddCube(mesh, -1000, 40);
  AddCube(mesh, 10, 20);
  AddCube(mesh, 12, 14);
  EXPECT_EQ(CountLit(Draw(mesh)), 40u * 40 * 40 - 10 * 10 * 10 + 2 * 2 * 2);
  // Far larger than the products that fit in 64 bits.
  ModelGeometry all = Filled();
  AddCube(all, -3e8, 3e8);
  EXPECT_EQ(CountLit(Draw(all)), uint64_t{kSize} * kSize * kSize);
}

TEST_P(FilledMeshes, RowsThatAreNotClosedHaveNoInside) {
  // Without its side at x = 30, a cube has no inside; without the side at z = 5 nothing changes,
  // since rows lie along x.
  ModelGeometry cube = Filled();
  AddCube(cube, 5, 30);
  ModelGeometry open = cube;
  open.indices.resize(30);
  open.record.index_count = 30;
  EXPECT_EQ(CountLit(Draw(open)), 0u);
  open.indices.assign(cube.indices.begin() + 6, cube.indices.end());
  EXPECT_EQ(CountLit(Draw(open)), 25u * 25 * 25);
  // Nor does it have one if the missing side is outside the volume.
  ModelGeometry large = Filled();
  AddCube(large, -5, 300);
  EXPECT_EQ(CountLit(Draw(large)), uint64_t{kSize} * kSize * kSize);
  large.indices.resize(30);
  large.record.index_count = 30;
  EXPECT_EQ(CountLit(Draw(large)), 0u);
}

TEST_P(FilledMeshes, WhatHasNoInsideLightsNothing) {
  ModelGeometry flat = Filled();
  AddCube(flat, 5, 30);
  EXPECT_EQ(CountLit(Draw(flat, {{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 9}})), 0u);
  EXPECT_EQ(CountLit(Draw(flat, {{0, 0, 0, 9.2, 0, 1, 0, 0, 0, 0, 1, 0}})), 0u);
  EXPECT_EQ(CountLit(Draw(flat, {{1, 0, 0, 500, 0, 1, 0, 0, 0, 0, 1, 0}})), 0u);
  EXPECT_EQ(CountLit(Draw(Filled())), 0u);
}

}  // namespace
}  // namespace voxeld::gpu::conformance
