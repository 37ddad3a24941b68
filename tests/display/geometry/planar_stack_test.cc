// Tests planar stacks with values computed by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"
#include "tests/display/geometry/table_reader.h"

namespace voxeld::display {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

auto Voxel(int32_t x, int32_t y, int32_t z, int32_t weight = 255) {
  return Pair(std::array<int32_t, 3>{x, y, z}, weight);
}

Geometry Stack(int width, int height, std::vector<double> positions) {
  PlanarStack stack;
  stack.width_px = width;
  stack.height_px = height;
  stack.positions_mm = std::move(positions);
  Geometry geometry;
  geometry.shape = stack;
  geometry.grid = DefaultGrid(geometry);
  return geometry;
}

PlanarStack& StackOf(Geometry& geometry) { return std::get<PlanarStack>(geometry.shape); }

TEST(PlanarStackTest, APixelOfItsOwnGridIsAVoxel) {
  for (const Sampling sampling : {Sampling::kMax, Sampling::kWeighted}) {
    Geometry geometry = Stack(16, 12, {0});
    // Spacings that no double holds exactly.
    StackOf(geometry).pitch_u_mm = 0.1;
    StackOf(geometry).pitch_v_mm = 0.3;
    StackOf(geometry).positions_mm = EvenPositions(10, 0.7, 1.1);
    geometry.grid = DefaultGrid(geometry);
    ASSERT_EQ(geometry.grid.nz, 10);
    const FootprintTable table = BuildFootprints(geometry, sampling);
    EXPECT_EQ(table.inner_sets, 1);
    EXPECT_EQ(table.inner_axis, Axis::kY);
    for (int32_t s = 0; s < 10; ++s) {
      for (int32_t u = 0; u < 16; ++u) {
        for (int32_t v = 0; v < 12; ++v) {
          ASSERT_THAT(ReadFootprint(table, s, u, v), ElementsAre(Voxel(u, v, s)));
        }
      }
    }
  }
}

TEST(PlanarStackTest, MirrorsFlipThePicture) {
  Geometry geometry = Stack(5, 4, EvenPositions(3, 1));
  StackOf(geometry).mirror_u = true;
  FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), ElementsAre(Voxel(4, 0, 0)));
  EXPECT_THAT(ReadFootprint(table, 2, 3, 1), ElementsAre(Voxel(1, 1, 2)));
  EXPECT_EQ(PixelPosition(geometry, 0, 0, 0), (Vec3{2, -1.5, -1}));
  StackOf(geometry).mirror_v = true;
  table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), ElementsAre(Voxel(4, 3, 0)));
  EXPECT_EQ(PixelPosition(geometry, 0, 0, 0), (Vec3{2, 1.5, -1}));
}

TEST(PlanarStackTest, FlatSlicesAscendFromBelow) {
  const Geometry geometry = Stack(5, 4, EvenPositions(3, 1));
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), ElementsAre(Voxel(0, 0, 0)));
  EXPECT_THAT(ReadFootprint(table, 0, 4, 0), ElementsAre(Voxel(4, 0, 0)));
  EXPECT_THAT(ReadFootprint(table, 0, 0, 3), ElementsAre(Voxel(0, 3, 0)));
  EXPECT_THAT(ReadFootprint(table, 2, 0, 0), ElementsAre(Voxel(0, 0, 2)));
  // Left, front and bottom are negative.
  EXPECT_EQ(PixelPosition(geometry, 0, 0, 0), (Vec3{-2, -1.5, -1}));
  EXPECT_EQ(PixelPosition(geometry, 2, 4, 0), (Vec3{2, -1.5, 1}));
}

TEST(PlanarStackTest, StandingSlicesGoFromFrontToBack) {
  Geometry geometry = Stack(5, 4, EvenPositions(3, 1));
  StackOf(geometry).normal = PlanarStack::Normal::kY;
  geometry.grid = DefaultGrid(geometry);
  EXPECT_EQ(geometry.grid.nx, 5);
  EXPECT_EQ(geometry.grid.ny, 3);
  EXPECT_EQ(geometry.grid.nz, 4);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_EQ(table.inner_axis, Axis::kZ);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), ElementsAre(Voxel(0, 0, 0)));
  EXPECT_THAT(ReadFootprint(table, 0, 4, 0), ElementsAre(Voxel(4, 0, 0)));
  EXPECT_THAT(ReadFootprint(table, 0, 0, 3), ElementsAre(Voxel(0, 0, 3)));
  EXPECT_THAT(ReadFootprint(table, 2, 0, 0), ElementsAre(Voxel(0, 2, 0)));
  EXPECT_EQ(PixelPosition(geometry, 2, 4, 0), (Vec3{2, 1, -1.5}));
}

TEST(PlanarStackTest, ListedPositionsStandForTheirSlabs) {
  // Slabs of slices at 1, 3, 4 and 8: [0, 2), [2, 3.5), [3.5, 6), [6, 10).
  Geometry geometry = Stack(1, 1, {1, 3, 4, 8});
  geometry.grid = {1, 1, 12, {1, 1, 1}, {-0.5, -0.5, -1}};  // voxel k is [k − 1, k)
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), ElementsAre(Voxel(0, 0, 1), Voxel(0, 0, 2)));
  // The middle of voxel 3 is 2.5; that of voxel 4, 3.5, belongs to the next slice, but the slice
  // lies in it.
  EXPECT_THAT(ReadFootprint(table, 1, 0, 0), ElementsAre(Voxel(0, 0, 3), Voxel(0, 0, 4)));
  EXPECT_THAT(ReadFootprint(table, 2, 0, 0),
              ElementsAre(Voxel(0, 0, 4), Voxel(0, 0, 5), Voxel(0, 0, 6)));
  EXPECT_THAT(ReadFootprint(table, 3, 0, 0),
              ElementsAre(Voxel(0, 0, 7), Voxel(0, 0, 8), Voxel(0, 0, 9), Voxel(0, 0, 10)));
}

TEST(PlanarStackTest, WeightsAreFullInTheNearerSliceAndPlaceTheVoxelBetweenBoth) {
  // Slices at 0 and 4; voxel k's middle is at k − 2.
  Geometry geometry = Stack(1, 1, {0, 4});
  geometry.grid = {1, 1, 10, {1, 1, 1}, {-0.5, -0.5, -2.5}};
  const FootprintTable table = BuildFootprints(geometry, Sampling::kWeighted);
  // The slab begins at −2, in the middle of voxel 0. Voxel 3 is 1 away from this slice and 3 from
  // the other: ratio 3 to 1; voxel 4 is half-way.
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0),
              ElementsAre(Voxel(0, 0, 0), Voxel(0, 0, 1), Voxel(0, 0, 2), Voxel(0, 0, 3),
                          Voxel(0, 0, 4), Voxel(0, 0, 5, 85)));
  // It ends at 6, in the middle of voxel 8, which is left out.
  EXPECT_THAT(ReadFootprint(table, 1, 0, 0),
              ElementsAre(Voxel(0, 0, 3, 85), Voxel(0, 0, 4), Voxel(0, 0, 5), Voxel(0, 0, 6),
                          Voxel(0, 0, 7)));
}

TEST(PlanarStackTest, AVoxelOnAPixelsCentreHasHalfTheWeightAtLeast) {
  // Four slices in each voxel: the two next to its middle have it in full; for the others it is
  // beyond a neighbour.
  Geometry geometry = Stack(1, 1, {0.125, 0.375, 0.625, 0.875});
  geometry.grid = {1, 1, 1, {1, 1, 1}, {-0.5, -0.5, 0}};
  const FootprintTable weighted = BuildFootprints(geometry, Sampling::kWeighted);
  const FootprintTable plain = BuildFootprints(geometry, Sampling::kMax);
  for (int32_t s = 0; s < 4; ++s) {
    EXPECT_THAT(ReadFootprint(weighted, s, 0, 0),
                ElementsAre(Voxel(0, 0, 0, s == 1 || s == 2 ? 255 : 128)))
        << s;
    EXPECT_THAT(ReadFootprint(plain, s, 0, 0), ElementsAre(Voxel(0, 0, 0))) << s;
  }
}

TEST(PlanarStackTest, ASingleSliceHasItsThickness) {
  Geometry geometry = Stack(1, 1, {2});
  StackOf(geometry).thickness_mm = 3;  // [0.5, 3.5)
  geometry.grid = {1, 1, 6, {1, 1, 1}, {-0.5, -0.5, 0}};
  for (const Sampling sampling : {Sampling::kMax, Sampling::kWeighted}) {
    const FootprintTable table = BuildFootprints(geometry, sampling);
    EXPECT_THAT(ReadFootprint(table, 0, 0, 0),
                ElementsAre(Voxel(0, 0, 0), Voxel(0, 0, 1), Voxel(0, 0, 2)));
  }
}

TEST(PlanarStackTest, FinerAndCoarserGrids) {
  Geometry geometry = Stack(2, 2, {0});
  geometry.grid = CentredGrid(4, 6, 1, {0.5, 1.0 / 3, 1});  // six by two voxels a pixel
  FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 1, 0),
              ElementsAre(Voxel(2, 0, 0), Voxel(2, 1, 0), Voxel(2, 2, 0), Voxel(3, 0, 0),
                          Voxel(3, 1, 0), Voxel(3, 2, 0)));

  geometry = Stack(4, 4, {0});
  geometry.grid = CentredGrid(1, 2, 1, {4, 2, 1});  // four by two pixels a voxel
  table = BuildFootprints(geometry, Sampling::kMax);
  for (int32_t u = 0; u < 4; ++u) {
    for (int32_t v = 0; v < 4; ++v) {
      EXPECT_THAT(ReadFootprint(table, 0, u, v), ElementsAre(Voxel(0, v / 2, 0)));
    }
  }
}

TEST(PlanarStackTest, PixelsBesideTheGridShowNothing) {
  Geometry geometry = Stack(4, 1, {0});
  geometry.grid = {2, 1, 1, {1, 1, 1}, {0, -0.5, -0.5}};
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), IsEmpty());
  EXPECT_THAT(ReadFootprint(table, 0, 1, 0), IsEmpty());
  EXPECT_THAT(ReadFootprint(table, 0, 2, 0), ElementsAre(Voxel(0, 0, 0)));
  EXPECT_THAT(ReadFootprint(table, 0, 3, 0), ElementsAre(Voxel(1, 0, 0)));
}

TEST(PlanarStackTest, AProjectorsTableIsSmall) {
  Geometry geometry = Stack(912, 1140, EvenPositions(192, 0.42));
  ASSERT_TRUE(ValidateGeometry(geometry).ok()) << ValidateGeometry(geometry);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_EQ(table.outer.entries.size(), 912u * 192u);
  EXPECT_EQ(table.inner.entries.size(), 1140u);
}

}  // namespace
}  // namespace voxeld::display
