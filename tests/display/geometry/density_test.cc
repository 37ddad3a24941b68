#include "display/geometry/density.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

Geometry StackAt(std::vector<double> positions) {
  PlanarStack stack;
  stack.width_px = 16;
  stack.height_px = 16;
  stack.positions_mm = std::move(positions);
  Geometry geometry{stack, {}};
  geometry.grid = DefaultGrid(geometry);
  return geometry;
}

std::vector<uint16_t> FactorsOf(const Geometry& geometry, uint16_t least,
                                Sampling sampling = Sampling::kMax) {
  return EvenFactors(BuildFootprints(geometry, sampling), geometry.grid, least);
}

TEST(Density, OfAnEvenDisplayIsFull) {
  std::vector<double> positions;
  for (int i = 0; i < 16; ++i) positions.push_back(i);
  EXPECT_TRUE(FactorsOf(StackAt(positions), 1).empty());
  // Voxels without a cube within reach are unchanged.
  EXPECT_TRUE(FactorsOf(StackAt({0, 1}), 1).size() <= size_t{2 * 16});
}

// Slices a millimetre apart have twice the light of those that are two millimetres apart.
TEST(Density, SlicesThatCrowdAreDimmed) {
  std::vector<double> positions;
  for (int i = 0; i < 16; ++i) positions.push_back(i);
  for (int i = 0; i < 12; ++i) positions.push_back(17 + 2 * i);
  const Geometry geometry = StackAt(positions);
  const std::vector<uint16_t> factors = FactorsOf(geometry, 1);
  ASSERT_EQ(factors.size(), positions.size() * 16);
  for (size_t s = 3; s < 13; ++s) EXPECT_NEAR(factors[s * 16 + 7] / 65535.0, 0.5, 0.03) << s;
  for (size_t s = 19; s < 25; ++s) EXPECT_NEAR(factors[s * 16 + 7] / 65535.0, 1, 0.03) << s;
}

// A panel through the axis passes a voxel for a time that decreases with its distance.
TEST(Density, OfARotorRisesWithTheDistance) {
  Rotor rotor;
  rotor.slices_per_turn = 360;
  rotor.width_px = 128;
  rotor.height_px = 8;
  rotor.panels.resize(1);
  Geometry geometry{rotor, {}};
  geometry.grid = DefaultGrid(geometry);
  const std::vector<uint16_t> factors = FactorsOf(geometry, 1);
  ASSERT_EQ(factors.size(), size_t{360} * 128);
  const auto mean = [&](size_t u) {
    double sum = 0;
    for (size_t s = 0; s < 360; ++s) sum += factors[s * 128 + u];
    return sum / 360 / 65535;
  };
  for (const size_t distance : {8u, 16u, 24u, 32u, 48u}) {
    const double want = static_cast<double>(distance) / 60;  // roughly full at the rim
    EXPECT_NEAR(mean(64 + distance) / want, 1, 0.12) << distance;
    EXPECT_NEAR(mean(63 - distance) / mean(64 + distance), 1, 0.1) << distance;
  }
}

TEST(Density, EveryVoxelHasAKeeper) {
  constexpr uint16_t kLeast = 40000;
  Rotor rotor;
  rotor.slices_per_turn = 90;
  rotor.width_px = 32;
  rotor.height_px = 8;
  rotor.panels.resize(2);
  rotor.panels[0].eccentricity_mm = 3.5;
  rotor.panels[0].shift_v_mm = 4;
  Geometry geometry{rotor, {}};
  geometry.grid = DefaultGrid(geometry);
  for (const Sampling sampling : {Sampling::kMax, Sampling::kWeighted}) {
    const FootprintTable table = BuildFootprints(geometry, sampling);
    const std::vector<uint16_t> factors = EvenFactors(table, geometry.grid, kLeast);
    ASSERT_EQ(factors.size(), table.outer.begin.size() - 1);
    const size_t nx = static_cast<size_t>(geometry.grid.nx);
    const size_t voxels = nx * static_cast<size_t>(geometry.grid.ny);
    for (int32_t set = 0; set < table.inner_sets; ++set) {
      std::vector<uint16_t> best(voxels), any(voxels);
      for (int32_t s = set; s < table.slices; s += table.inner_sets) {
        for (int32_t u = 0; u < table.width; ++u) {
          for (const FootprintEntry& e : table.Outer(s, u)) {
            if (e.weight != kFullWeight) continue;
            const size_t at = e.y * nx + e.x;
            any[at] = 1;
            best[at] = std::max(best[at], factors[static_cast<size_t>(s * table.width + u)]);
          }
        }
      }
      for (size_t at = 0; at < voxels; ++at) {
        if (any[at] == 0) continue;
        EXPECT_GE(best[at], kLeast) << "voxel " << at << " of set " << set;
      }
    }
  }
}

// Lights in a cluster are dimmed, an isolated one is not.
TEST(Density, OfLightsAtPoints) {
  Lattice lattice;
  lattice.cell_mm = {1, 1, 1};
  for (int z = 0; z < 8; ++z) {
    for (int y = 0; y < 8; ++y) {
      for (int x = 0; x < 8; ++x) {
        lattice.points_mm.emplace_back(Vec3{x + 0.5, y + 0.5, z + 0.5});
        if (x < 4) lattice.points_mm.emplace_back(Vec3{x + 0.4, y + 0.5, z + 0.5});
      }
    }
  }
  lattice.width_px = static_cast<int32_t>(lattice.points_mm.size());
  Geometry geometry{lattice, {}};
  geometry.grid = DefaultGrid(geometry);
  const std::vector<uint16_t> factors = FactorsOf(geometry, 1);
  ASSERT_EQ(factors.size(), lattice.points_mm.size());
  double crowded = 0, alone = 0;
  int crowded_count = 0, alone_count = 0;
  for (size_t i = 0; i < factors.size(); ++i) {
    const double x = lattice.points_mm[i]->x;
    if (x < 2) crowded += factors[i], ++crowded_count;
    if (x > 6) alone += factors[i], ++alone_count;
  }
  EXPECT_LT(crowded / crowded_count, 0.65 * alone / alone_count);
  EXPECT_GT(alone / alone_count, 0.95 * 65535);
}

}  // namespace
}  // namespace voxeld::display
