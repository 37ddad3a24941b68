// Tests sparse voxels with a lattice of their own: points drawn as cells, under transforms.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "tests/conformance/conformance_test.h"

namespace voxeld::gpu::conformance {
namespace cells_test {

constexpr uint32_t kRed = 0xFF0000, kGreen = 0x00FF00;
constexpr int32_t kSide = 40;

class Cells : public EngineConformance {
 protected:
  Cells() {
    geometry_.record.id = 1;
    geometry_.record.kind = PrimitiveKind::kPoints;
    geometry_.record.splat = Splat::kCell;
    geometry_.record.color_mode = ColorMode::kPerVertex;
  }

  void Add(float x, float y, float z, uint32_t rgb) {
    geometry_.positions.insert(geometry_.positions.end(), {x, y, z});
    geometry_.colors.push_back(rgb);
    geometry_.record.vertex_count = static_cast<uint32_t>(geometry_.colors.size());
  }
  // Turns by 30° about two axes, with `edge` voxels a cell; the origin is neither a corner nor a
  // centre of a voxel.
  void Turn(double edge) {
    const double c = std::cos(std::numbers::pi / 6), s = std::sin(std::numbers::pi / 6);
    const double turn[9] = {c, -s * c, s * s, s, c * c, -c * s, 0, s, c};
    for (int i = 0; i < 9; ++i) transform_.m[i / 3 * 4 + i % 3] = edge * turn[i];
    for (int a = 0; a < 3; ++a) transform_.m[a * 4 + 3] = 19.8125 + a * 0.203125;
  }
  // Draws all voxels with the engine, and checks them against the oracle.
  std::vector<uint32_t> Draw() { return DrawnLikeOracle(SceneOf(geometry_, transform_), target_); }
  static uint64_t Count(const std::vector<uint32_t>& voxels, uint32_t rgb) {
    return static_cast<uint64_t>(std::count(voxels.begin(), voxels.end(), rgb));
  }

  const Target target_ = CubeTarget(kSide);
  ModelGeometry geometry_;
  Affine transform_;
};

INSTANTIATE_TEST_SUITE_P(Engines, Cells, testing::ValuesIn(EngineCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(Cells, AreVoxelsWhereTheLatticesAreOne) {
  Add(3, 4, 5, kRed);
  Add(4, 4, 5, kGreen);
  Add(3.75f, 8.5f, 5.25f, kRed);  // in the cell (3, 8, 5)
  const std::vector<uint32_t> voxels = Draw();
  const auto at = [&](int32_t x, int32_t y, int32_t z) {
    return voxels[static_cast<size_t>((z * kSide + y) * kSide + x)];
  };
  EXPECT_EQ(at(3, 4, 5), kRed);
  EXPECT_EQ(at(4, 4, 5), kGreen);
  EXPECT_EQ(at(3, 8, 5), kRed);
  EXPECT_EQ(Count(voxels, kRed) + Count(voxels, kGreen), 3u);
}

TEST_P(Cells, AreCubesOfTheTransformsSize) {
  for (int a = 0; a < 3; ++a) transform_.m[a * 4 + a] = 3;
  Add(1, 2, 3, kRed);
  Add(2, 2, 3, kGreen);
  const std::vector<uint32_t> voxels = Draw();
  EXPECT_EQ(Count(voxels, kRed), 27u);
  EXPECT_EQ(Count(voxels, kGreen), 27u);
  EXPECT_EQ(voxels[(9 * kSide + 6) * kSide + 3], kRed);
  EXPECT_EQ(voxels[(11 * kSide + 8) * kSide + 8], kGreen);
}

// A turned block of cells with alternating colours has neither gaps nor voxels outside: it equals
// the solid box.
TEST_P(Cells, SideBySideLeaveNoGaps) {
  constexpr int32_t kCells = 4;
  Turn(3.7);
  for (int32_t i = 0; i < kCells * kCells * kCells; ++i) {
    const int32_t x = i % kCells, y = i / kCells % kCells, z = i / kCells / kCells;
    Add(static_cast<float>(x - 2), static_cast<float>(y - 2), static_cast<float>(z - 2),
        (x + y + z) % 2 == 0 ? kRed : kGreen);
  }
  const std::vector<uint32_t> cells = Draw();
  EXPECT_GT(Count(cells, kRed), 1200u);  // half of 14.8³ = 3,242
  EXPECT_GT(Count(cells, kGreen), 1200u);
  geometry_ = SolidBox(1, {0, 0, 0}, {4, 4, 4}, kRed);
  const std::vector<uint32_t> box = Draw();
  ASSERT_EQ(cells.size(), box.size());
  uint64_t others = 0;
  for (size_t i = 0; i < box.size(); ++i) others += (cells[i] != 0) != (box[i] != 0);
  EXPECT_EQ(others, 0u);
}

TEST_P(Cells, SmallerThanVoxelsAreStillSeen) {
  Turn(0.01);
  Add(0, 0, 0, kRed);
  EXPECT_EQ(Count(Draw(), kRed), 1u);
  for (double& number : transform_.m) number = 0;
  for (int a = 0; a < 3; ++a) transform_.m[a * 4 + 3] = 7.5;
  EXPECT_EQ(Count(Draw(), kRed), 1u) << "flattened to one place";
}

}  // namespace cells_test
}  // namespace voxeld::gpu::conformance
