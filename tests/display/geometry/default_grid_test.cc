#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

Geometry Stack(std::vector<double> positions) {
  PlanarStack stack;
  stack.width_px = 10;
  stack.height_px = 6;
  stack.pitch_u_mm = 0.5;
  stack.pitch_v_mm = 2;
  stack.positions_mm = std::move(positions);
  return {stack, {}};
}

TEST(DefaultGridTest, AnEvenStackHasALayerASlice) {
  const VoxelGrid grid = DefaultGrid(Stack({1, 1.75, 2.5, 3.25}));
  EXPECT_EQ(grid, (VoxelGrid{10, 6, 4, {0.5, 2, 0.75}, {-2.5, -6, 0.625}}));
}

TEST(DefaultGridTest, NearlyEvenIsEven) {
  EXPECT_EQ(DefaultGrid(Stack({0, 1, 2 + 1e-9, 3})).nz, 4);
  // Off by a thousandth: depth 3.9995 over the least spacing 0.999.
  EXPECT_EQ(DefaultGrid(Stack({0, 0.999, 2, 3})).nz, 4);
}

TEST(DefaultGridTest, AnUnevenStackHasLayersOfItsLeastSpacing) {
  // Slabs from −0.25 to 8: 8.25 / 0.5 = 16.5.
  const VoxelGrid grid = DefaultGrid(Stack({0, 0.5, 2, 6}));
  EXPECT_EQ(grid.nz, 17);
  EXPECT_DOUBLE_EQ(grid.pitch_mm.z, 8.25 / 17);
  EXPECT_DOUBLE_EQ(grid.origin_mm.z, -0.25);
}

TEST(DefaultGridTest, LayersOfAnUnevenStackAreLimited) {
  const VoxelGrid grid = DefaultGrid(Stack({0, 0.001, 100}));
  EXPECT_EQ(grid.nz, 4096);
  EXPECT_DOUBLE_EQ(grid.nz * grid.pitch_mm.z, 100 + 0.5 * 99.999 + 0.0005);
}

TEST(DefaultGridTest, ASingleSliceHasOneLayerOfItsThickness) {
  Geometry geometry = Stack({5});
  std::get<PlanarStack>(geometry.shape).thickness_mm = 3;
  EXPECT_EQ(DefaultGrid(geometry), (VoxelGrid{10, 6, 1, {0.5, 2, 3}, {-2.5, -6, 3.5}}));
}

TEST(DefaultGridTest, AStandingStacksLayersLieAlongY) {
  Geometry geometry = Stack({-1, 0, 1});
  std::get<PlanarStack>(geometry.shape).normal = PlanarStack::Normal::kY;
  EXPECT_EQ(DefaultGrid(geometry), (VoxelGrid{10, 3, 6, {0.5, 1, 2}, {-2.5, -1.5, -6}}));
}

TEST(DefaultGridTest, ARotorsGridCoversWhatItsCornersDescribe) {
  // √(64² + 13.5²) = 65.4.
  EXPECT_EQ(DefaultGrid({Vortex(360), {}}), CentredGrid(132, 132, 64, {1, 1, 1}));
}

TEST(DefaultGridTest, ARotorOfAWholeRadiusHasNoCellTooMany) {
  Rotor rotor = Vortex(360);
  rotor.panels = {{.pitch_u_mm = 0.1, .pitch_v_mm = 0.3}};
  const VoxelGrid grid = DefaultGrid({rotor, {}});
  EXPECT_EQ(grid.nx, 128);
  EXPECT_EQ(grid.ny, 128);
  EXPECT_EQ(grid.nz, 64);
}

TEST(DefaultGridTest, ARotorsGridCoversAllPanelsHeights) {
  Rotor rotor = Vortex(360);
  rotor.panels[0].pitch_v_mm = 0.5;   // −16 to 16
  rotor.panels[1].shift_v_mm = 0.25;  // −31.75 to 32.25
  const VoxelGrid grid = DefaultGrid({rotor, {}});
  EXPECT_EQ(grid.nz, 128);
  EXPECT_DOUBLE_EQ(grid.pitch_mm.z, 0.5);
  EXPECT_DOUBLE_EQ(grid.origin_mm.z, -31.75);
}

TEST(DefaultGridTest, ARegularLatticeHasAVoxelALight) {
  // Pitches that no double holds exactly.
  const Lattice lattice = RegularLattice(7, 5, 4, {0.1, 0.3, 1.7});
  const VoxelGrid grid = DefaultGrid({lattice, {}});
  EXPECT_EQ(grid.nx, 7);
  EXPECT_EQ(grid.ny, 5);
  EXPECT_EQ(grid.nz, 4);
  EXPECT_EQ(grid.pitch_mm, lattice.cell_mm);
  EXPECT_DOUBLE_EQ(grid.origin_mm.x, -0.35);
  EXPECT_DOUBLE_EQ(grid.origin_mm.y, -0.75);
  EXPECT_DOUBLE_EQ(grid.origin_mm.z, -3.4);
}

TEST(DefaultGridTest, ALatticesGridCoversAllBoxes) {
  Lattice lattice;
  lattice.width_px = 3;
  lattice.points_mm = {Vec3{-1, 5, 2}, std::nullopt, Vec3{2.25, 5, 3}};
  lattice.cell_mm = {1, 2, 0.75};
  // Along x 4.25 mm of cells of 1; along y one box; along z 1.75 of cells of 0.75.
  EXPECT_EQ(DefaultGrid({lattice, {}}), (VoxelGrid{5, 1, 3, {1, 2, 0.75}, {-1.5, 4, 1.625}}));
}

TEST(DefaultGridTest, SuitsItsShape) {
  for (const GeometryCase& c : AllCases()) {
    Geometry geometry = c.geometry;
    geometry.grid = DefaultGrid(geometry);
    EXPECT_TRUE(ValidateGeometry(geometry).ok()) << c.name << ": " << ValidateGeometry(geometry);
  }
}

TEST(DefaultGridTest, AbsurdButValidShapesGiveAGridThatValidationRefuses) {
  Rotor rotor = Vortex(360);
  rotor.panels[0].eccentricity_mm = 1e6;
  rotor.panels[0].pitch_u_mm = 1e-4;
  Geometry geometry{rotor, {}};
  ASSERT_TRUE(ValidateShape(geometry).ok());
  geometry.grid = DefaultGrid(geometry);
  EXPECT_FALSE(ValidateGeometry(geometry).ok());

  Lattice lattice;
  lattice.width_px = 2;
  lattice.points_mm = {Vec3{-1e6, -1e6, -1e6}, Vec3{1e6, 1e6, 1e6}};
  lattice.cell_mm = {1e-4, 1e-4, 1e-4};
  geometry = {lattice, {}};
  ASSERT_TRUE(ValidateShape(geometry).ok());
  geometry.grid = DefaultGrid(geometry);
  EXPECT_FALSE(ValidateGeometry(geometry).ok());
}

}  // namespace
}  // namespace voxeld::display
