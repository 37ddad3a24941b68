// Tests each limit from both sides, and the bounds on tables, computed by hand.
#include "display/geometry/limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string GridRefusal(const Geometry& geometry) {
  return std::string(ValidateGeometry(geometry).message());
}
std::string ShapeRefusal(const Geometry& geometry) {
  return std::string(ValidateShape(geometry).message());
}

PlanarStack OnePixelStack(std::vector<double> positions, int strokes = 1) {
  PlanarStack stack;
  stack.width_px = stack.height_px = 1;
  stack.positions_mm = std::move(positions);
  stack.strokes = strokes;
  return stack;
}

// As wide and high in pixels, and as high as its distance from the axis.
Helix HelixOf(int slices, int pixels, int blades, double span_turns, double mm) {
  Helix helix;
  helix.slices_per_turn = slices;
  helix.width_px = helix.height_px = pixels;
  helix.blades = blades;
  helix.span_turns = span_turns;
  helix.height_mm = helix.radius_mm = mm;
  return helix;
}

TEST(Limits, PicturesTogether) {
  PlanarStack stack = OnePixelStack(EvenPositions(64, 1, 0));
  stack.width_px = stack.height_px = 16384;  // 2^34 pixels
  EXPECT_TRUE(ValidateShape({stack, {}}).ok());
  stack.positions_mm = EvenPositions(65, 1, 0);
  EXPECT_THAT(ShapeRefusal({stack, {}}),
              HasSubstr("is 17448304640: it must be at most 17179869184"));
  Helix helix = HelixOf(65, 16384, 1, 0.1, 1);
  EXPECT_THAT(ShapeRefusal({helix, {}}), HasSubstr("(65·16384·16384) is 17448304640"));
  helix.slices_per_turn = 64;
  EXPECT_TRUE(ValidateShape({helix, {}}).ok());
}

TEST(Limits, CellsTogether) {
  Geometry geometry{OnePixelStack({0, 1}), CentredGrid(16384, 16384, 256, {1, 1, 1})};  // 2^36
  EXPECT_EQ(GridRefusal(geometry), "");
  geometry.grid.nz = 257;
  EXPECT_THAT(GridRefusal(geometry),
              StartsWith("grid.nx·ny·nz (16384·16384·257) is 68987912192: "));
}

TEST(Limits, PositionsOfAStroke) {
  const auto refusal = [](std::vector<double> positions, int strokes = 1) {
    return ShapeRefusal({OnePixelStack(std::move(positions), strokes), {}});
  };
  EXPECT_EQ(refusal({0, 1, 5}), "");
  EXPECT_EQ(refusal({5, 1, 0}), "");
  EXPECT_EQ(refusal({0, 2, 2, 1}, 2), "");
  EXPECT_THAT(refusal({1, 1}),
              StartsWith("positions_mm[1] is 1: it must be below positions_mm[0], 1:"));
  EXPECT_THAT(refusal({1, 2, 0}),
              StartsWith("positions_mm[2] is 0: it must be above positions_mm[1], 2:"));
  EXPECT_THAT(refusal({2, 1, 1}),
              StartsWith("positions_mm[2] is 1: it must be below positions_mm[1], 1:"));
  EXPECT_THAT(refusal({0, 2, 1, 2}, 2),
              StartsWith("positions_mm[3] is 2: it must be below positions_mm[2], 1:"));
  EXPECT_THAT(refusal({std::numeric_limits<double>::quiet_NaN(), 1}),
              StartsWith("positions_mm[0] is nan: "));
  // It must not be taken for the limit itself.
  EXPECT_THAT(refusal({-1000000.5, 1}),
              StartsWith("positions_mm[0] is -1000000.5: it must be from -1000000 to 1000000 mm"));
  EXPECT_THAT(refusal({-1.1e6, 1}), StartsWith("positions_mm[0] is -1100000: "));
}

// At least 1/1024 of the pitch along the normal.
TEST(Limits, SpacingOfSlices) {
  for (const auto normal : {PlanarStack::Normal::kZ, PlanarStack::Normal::kY}) {
    const bool flat = normal == PlanarStack::Normal::kZ;
    PlanarStack stack = OnePixelStack({0, 0.5 / 1024, 1});
    stack.normal = normal;
    Geometry geometry{stack, CentredGrid(2, 2, 2, {1, flat ? 1 : 0.5, flat ? 0.5 : 1})};
    EXPECT_EQ(GridRefusal(geometry), "");
    std::get<PlanarStack>(geometry.shape).positions_mm = {0, 0.5, 0.5 + 0.499 / 1024};
    EXPECT_THAT(GridRefusal(geometry),
                StartsWith("positions_mm[2] − positions_mm[1] is 0.0004873"));
    // The turning point is not a spacing.
    PlanarStack twice = OnePixelStack({0, 1, 1, 0}, 2);
    twice.normal = normal;
    EXPECT_EQ(GridRefusal({twice, geometry.grid}), "");
  }
}

TEST(Limits, TableOfAStack) {
  PlanarStack stack = OnePixelStack({0, 1});
  stack.width_px = 16384;
  // (nx + width_px) · (2 · nz · strokes + slices)
  EXPECT_THAT(GridRefusal({stack, CentredGrid(16384, 1, 16384, {1, 1, 1})}),
              HasSubstr("table is 1073807360: it must be at most 268435456 entries"));
  stack.positions_mm = {0, 1, 1, 0};
  stack.strokes = 2;
  EXPECT_THAT(GridRefusal({stack, CentredGrid(16384, 1, 16384, {1, 1, 1})}),
              HasSubstr("table is 2147614720:"));
  // Seen along y: 32768 · (2 · 4096 · 2 + 4)
  stack.normal = PlanarStack::Normal::kY;
  EXPECT_THAT(GridRefusal({stack, CentredGrid(16384, 4096, 3, {1, 1, 1})}),
              HasSubstr("table is 537001984:"));
}

TEST(Limits, TableOfARotor) {
  Rotor rotor;
  rotor.slices_per_turn = 16384;
  rotor.width_px = 3;
  rotor.height_px = 1;
  rotor.panels.resize(1);
  // panels · (4 · nx · ny + slices · (width_px + 1)): 268369920 + 65536, which is the most
  Geometry geometry{rotor, CentredGrid(16384, 4095, 1, {1, 1, 1})};
  EXPECT_EQ(GridRefusal(geometry), "");
  std::get<Rotor>(geometry.shape).width_px = 4;
  EXPECT_THAT(GridRefusal(geometry), HasSubstr("table is 268451840:"));
  std::get<Rotor>(geometry.shape).panels.resize(2);
  EXPECT_THAT(GridRefusal(geometry), HasSubstr("table is 536903680:"));
}

TEST(Limits, ReachOfARotor) {
  Rotor rotor;
  rotor.slices_per_turn = rotor.width_px = rotor.height_px = 4;
  rotor.panels.resize(1);
  rotor.panels[0].tilt_deg = -60;
  EXPECT_TRUE(ValidateShape({rotor, {}}).ok());
  rotor.panels[0].tilt_deg = 0;
  // 16384 times the smaller horizontal pitch: 32768 mm
  Geometry geometry{rotor, {1024, 2, 2, {2, 3, 1}, {30720, 0, 0}}};
  EXPECT_EQ(GridRefusal(geometry), "");
  geometry.grid.origin_mm.x = 30721;
  EXPECT_THAT(GridRefusal(geometry),
              StartsWith("the grid's far end along x is 32769: it must be within 32768 mm"));
  geometry.grid.origin_mm = {0, -32769, 0};
  EXPECT_THAT(GridRefusal(geometry), StartsWith("grid.origin_mm.y is -32769: "));
}

TEST(Limits, TableOfALattice) {
  Lattice lattice;
  lattice.width_px = 1;
  lattice.points_mm = {Vec3{0, 0, 0}, std::nullopt, Vec3{1, 1, 1}};
  lattice.cell_mm = {10000, 50, 150};
  // For the box of 20000 by 100 by 300 voxels: 16384 · 101 · 256 centres and one voxel, for each of
  // two lights
  Geometry geometry{lattice, CentredGrid(16384, 16384, 256, {0.5, 0.5, 0.5})};
  EXPECT_THAT(GridRefusal(geometry), HasSubstr("table is 847249410:"));
  geometry.grid.pitch_mm = {1, 1, 2};  // 10001 · 51 · 76 and one, of each
  EXPECT_EQ(GridRefusal(geometry), "");
  std::get<Lattice>(geometry.shape).points_mm.resize(9, Vec3{1, 1, 1});
  EXPECT_THAT(GridRefusal(geometry), HasSubstr("table is 310111016:"));
}

TEST(Limits, TableWhereFootprintsAreKeptPixelByPixel) {
  // passes · nx · ny · nz + slices · width in whole bytes · height + 2 · nz · slices
  PlanarStack stack = OnePixelStack({0, 1});
  stack.width_px = 9;
  stack.height_px = 3;
  EXPECT_THAT(GridRefusal({stack, CentredGrid(2048, 1024, 64, {1, 1, 1}), Correction{}}),
              HasSubstr("table is 268435808:"));  // 2 passes: 2^28 + 96 + 256
  stack.positions_mm = {0, 1, 1, 0};
  stack.strokes = 2;
  EXPECT_THAT(GridRefusal({stack, CentredGrid(1024, 1024, 64, {1, 1, 1}), Correction{}}),
              HasSubstr("table is 268436160:"));  // 4 passes: 2^28 + 192 + 512
  const Helix helix = HelixOf(20, 16, 3, 0.25, 8);
  EXPECT_THAT(GridRefusal({helix, CentredGrid(1024, 1024, 64, {1, 1, 1})}),
              HasSubstr("table is 402660864:"));  // 6 passes: 6 · 2^26 + 5120 + 2560
  Rotor rotor;
  rotor.slices_per_turn = 10;
  rotor.width_px = 8;
  rotor.height_px = 3;
  rotor.panels.resize(2);
  rotor.panels[0].tilt_deg = 1;
  EXPECT_THAT(GridRefusal({rotor, CentredGrid(512, 1024, 64, {1, 1, 1})}),
              HasSubstr("table is 268438496:"));  // 8 passes: 2^28 + 480 + 2560
}

TEST(Limits, RowsInWholeBytesPixelByPixel) {
  PlanarStack stack = OnePixelStack(EvenPositions(512, 1, 0));
  stack.width_px = 505;  // a row of 512
  stack.height_px = 512;
  const VoxelGrid grid = CentredGrid(2, 2, 2, {1, 1, 1});
  EXPECT_EQ(GridRefusal({stack, grid, Correction{}}), "");  // 2^27 exactly
  stack.height_px = 513;
  EXPECT_THAT(GridRefusal({stack, grid, Correction{}}),
              HasSubstr("(512·512·513) is 134479872: it must be at most 134217728"));
}

TEST(Limits, WhatAHelixSpans) {
  Helix helix = HelixOf(4, 4, 2, 0.1, 1);
  EXPECT_EQ(ShapeRefusal({helix, {}}), "");
  helix.span_turns = 0.5;
  EXPECT_EQ(ShapeRefusal({helix, {}}), "");
  helix.span_turns = 0.5000001;
  EXPECT_THAT(ShapeRefusal({helix, {}}),
              StartsWith("span_turns is 0.5000001: it must be from 0.1 to 1 / blades, 0.5: "));
}

TEST(Limits, RowsMayBeOddButInHub75) {
  EXPECT_TRUE(ValidateFormat({.height = 3}).ok());
  EXPECT_TRUE(ValidateFormat({.height = 3, .format = PixelFormat::kRgb332, .bits = 3}).ok());
}

}  // namespace
}  // namespace voxeld::display
