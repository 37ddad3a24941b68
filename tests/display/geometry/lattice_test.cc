// Tests lattices with values computed by hand.
#include <cmath>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"
#include "tests/display/geometry/table_reader.h"

namespace voxeld::display {
namespace lattice_test {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

auto Voxel(int32_t x, int32_t y, int32_t z) { return Pair(std::array<int32_t, 3>{x, y, z}, 255); }

// One light in a grid of 8·8·8 cells of 1 mm from the origin on.
Geometry OneLight(Vec3 at, Vec3 cell_mm) {
  Lattice lattice{.width_px = 1, .points_mm = {at}, .cell_mm = cell_mm};
  return {lattice, {8, 8, 8, {1, 1, 1}, {0, 0, 0}}};
}

Footprint FootprintOf(const Geometry& geometry) {
  const FootprintTable weighted = BuildFootprints(geometry, Sampling::kWeighted);
  EXPECT_EQ(weighted, BuildFootprints(geometry, Sampling::kMax));
  return ReadFootprint(weighted, 0, 0, 0);
}

TEST(LatticeTest, ARegularOnesLightIsAVoxel) {
  for (const Vec3 pitch : {Vec3{1, 1, 1}, Vec3{0.1, 0.3, 0.7}, Vec3{33.3, 1e-3, 7}}) {
    Geometry geometry{RegularLattice(7, 5, 6, pitch), {}};
    geometry.grid = DefaultGrid(geometry);
    const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
    for (int32_t s = 0; s < 6; ++s) {
      for (int32_t u = 0; u < 35; ++u) {
        ASSERT_THAT(ReadFootprint(table, s, u, 0), ElementsAre(Voxel(u % 7, u / 7, s)));
      }
    }
  }
}

TEST(LatticeTest, ATableOfRows) {
  const Geometry geometry{RegularLattice(4, 3, 2, {1, 1, 1}), CentredGrid(4, 3, 2, {1, 1, 1})};
  EXPECT_EQ(SliceCount(geometry), 2);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_EQ(table.slices, 2);
  EXPECT_EQ(table.width, 12);
  EXPECT_EQ(table.height, 1);
  EXPECT_EQ(table.inner_sets, 1);
  EXPECT_EQ(table.inner_axis, Axis::kZ);
  EXPECT_THAT(table.inner.entries, ElementsAre(FootprintEntry{0, 0, 0, 255}));
  EXPECT_THAT(table.Outer(1, 5), ElementsAre(FootprintEntry{1, 1, 1, 255}));
}

TEST(LatticeTest, TheCentresInTheHalfOpenBoxAndTheVoxelThatHoldsTheLight) {
  // Along x [2, 4): 2.5 and 3.5. Along y [1.5, 4.5): 1.5 to 3.5. Along z [4.5, 5.5): 4.5. The light
  // is in (3, 3, 5), whose centre at height 5.5 is not one of these.
  EXPECT_THAT(FootprintOf(OneLight({3, 3, 5}, {2, 3, 1})),
              ElementsAre(Voxel(2, 1, 4), Voxel(2, 2, 4), Voxel(2, 3, 4), Voxel(3, 1, 4),
                          Voxel(3, 2, 4), Voxel(3, 3, 4), Voxel(3, 3, 5)));
}

TEST(LatticeTest, ABoxWithoutACentreLeavesTheVoxelThatHoldsTheLight) {
  EXPECT_THAT(FootprintOf(OneLight({2.2, 3.9, 4}, {0.1, 0.1, 0.1})), ElementsAre(Voxel(2, 3, 4)));
  // Thin along x only: along y and z it would reach three voxels.
  EXPECT_THAT(FootprintOf(OneLight({2.2, 3.5, 4.5}, {0.1, 3, 3})), ElementsAre(Voxel(2, 3, 4)));
}

TEST(LatticeTest, BoxesEndWithTheGrid) {
  EXPECT_THAT(FootprintOf(OneLight({7.5, 0.5, 4.5}, {3, 3, 1})),
              ElementsAre(Voxel(6, 0, 4), Voxel(6, 1, 4), Voxel(7, 0, 4), Voxel(7, 1, 4)));
  EXPECT_EQ(FootprintOf(OneLight({4, 4, 4}, {100, 100, 100})).size(), 512u);
}

TEST(LatticeTest, ALightBesideTheGridStandsForWhatItsBoxReaches) {
  EXPECT_THAT(FootprintOf(OneLight({-0.4, 4.5, 4.5}, {2, 1, 1})), ElementsAre(Voxel(0, 4, 4)));
  EXPECT_THAT(FootprintOf(OneLight({-0.6, 4.5, 4.5}, {2, 1, 1})), IsEmpty());
  EXPECT_THAT(FootprintOf(OneLight({4.5, 4.5, 8}, {1, 1, 0.5})), IsEmpty());
  EXPECT_THAT(FootprintOf(OneLight({-1e6, 1e6, 0}, {1, 1, 1})), IsEmpty());
}

TEST(LatticeTest, AnAbsentLightsPixelStandsForNothing) {
  Geometry geometry = OneLight({2.5, 2.5, 2.5}, {1, 1, 1});
  auto& lattice = std::get<Lattice>(geometry.shape);
  lattice.width_px = 3;
  lattice.points_mm = {std::nullopt, Vec3{2.5, 2.5, 2.5}, std::nullopt};
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), IsEmpty());
  EXPECT_THAT(ReadFootprint(table, 0, 1, 0), ElementsAre(Voxel(2, 2, 2)));
  EXPECT_THAT(ReadFootprint(table, 0, 2, 0), IsEmpty());
  EXPECT_TRUE(std::isnan(PixelPosition(geometry, 0, 0, 0).y));
  EXPECT_EQ(PixelPosition(geometry, 0, 1, 0), (Vec3{2.5, 2.5, 2.5}));
}

TEST(LatticeTest, LightsInOnePlaceStandForTheSame) {
  Geometry geometry = OneLight({2.5, 2.5, 2.5}, {1, 1, 1});
  auto& lattice = std::get<Lattice>(geometry.shape);
  lattice.width_px = 2;
  lattice.points_mm.assign(4, Vec3{2.5, 2.5, 2.5});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  for (const int32_t s : {0, 1}) {
    for (const int32_t u : {0, 1}) {
      EXPECT_THAT(ReadFootprint(table, s, u, 0), ElementsAre(Voxel(2, 2, 2)));
    }
  }
}

}  // namespace lattice_test
}  // namespace voxeld::display
