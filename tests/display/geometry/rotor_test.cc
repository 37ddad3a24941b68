// Tests rotors with values computed by hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"
#include "tests/display/geometry/table_reader.h"

namespace voxeld::display {
namespace rotor_test {

using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::Not;
using testing::Pair;

auto Voxel(int32_t x, int32_t y, int32_t z, int32_t weight = 255) {
  return Pair(std::array<int32_t, 3>{x, y, z}, weight);
}

Geometry OnePanel(int slices_per_turn, int width, int height, Rotor::Panel panel = {}) {
  Rotor rotor;
  rotor.slices_per_turn = slices_per_turn;
  rotor.width_px = width;
  rotor.height_px = height;
  rotor.panels = {panel};
  Geometry geometry;
  geometry.shape = rotor;
  geometry.grid = DefaultGrid(geometry);
  return geometry;
}

Rotor& RotorOf(Geometry& geometry) { return std::get<Rotor>(geometry.shape); }

void ExpectAt(const Geometry& geometry, int32_t slice, int32_t u, int32_t v, Vec3 expected) {
  const Vec3 p = PixelPosition(geometry, slice, u, v);
  EXPECT_NEAR(p.x, expected.x, 1e-7) << slice;
  EXPECT_NEAR(p.y, expected.y, 1e-7) << slice;
  EXPECT_NEAR(p.z, expected.z, 1e-7) << slice;
}

// Eight pixels along u, three upwards; the plane is 1.5 behind the axis, which is ahead of it along
// +y at turn angle 0.
TEST(RotorTest, QuarterTurnsCounterClockwise) {
  Geometry geometry = OnePanel(4, 8, 3, {.eccentricity_mm = 1.5});
  geometry.grid = CentredGrid(10, 10, 3, {1, 1, 1});
  ExpectAt(geometry, 0, 0, 0, {-3.5, 1.5, -1});
  ExpectAt(geometry, 1, 0, 0, {-1.5, -3.5, -1});
  ExpectAt(geometry, 2, 0, 0, {3.5, -1.5, -1});
  ExpectAt(geometry, 3, 0, 0, {1.5, 3.5, -1});
  ExpectAt(geometry, 0, 7, 2, {3.5, 1.5, 1});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 0, 0, 0), Contains(Voxel(1, 6, 0)));
  EXPECT_THAT(ReadFootprint(table, 1, 0, 0), Contains(Voxel(3, 1, 0)));
  EXPECT_THAT(ReadFootprint(table, 2, 0, 0), Contains(Voxel(8, 3, 0)));
  EXPECT_THAT(ReadFootprint(table, 3, 0, 0), Contains(Voxel(6, 8, 0)));
  EXPECT_THAT(ReadFootprint(table, 0, 7, 2), Contains(Voxel(8, 6, 2)));
}

TEST(RotorTest, QuarterTurnsClockwise) {
  Geometry geometry = OnePanel(4, 8, 3, {.eccentricity_mm = 1.5});
  RotorOf(geometry).clockwise = true;
  geometry.grid = CentredGrid(10, 10, 3, {1, 1, 1});
  ExpectAt(geometry, 0, 0, 0, {-3.5, 1.5, -1});
  ExpectAt(geometry, 1, 0, 0, {1.5, 3.5, -1});
  ExpectAt(geometry, 2, 0, 0, {3.5, -1.5, -1});
  ExpectAt(geometry, 3, 0, 0, {-1.5, -3.5, -1});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(table, 1, 0, 0), Contains(Voxel(6, 8, 0)));
  EXPECT_THAT(ReadFootprint(table, 3, 0, 0), Contains(Voxel(3, 1, 0)));
}

TEST(RotorTest, APhaseIsCounterClockwiseWhateverTheTurning) {
  Geometry geometry = OnePanel(4, 8, 3, {.eccentricity_mm = 1.5, .phase_turns = 0.25});
  for (const bool clockwise : {false, true}) {
    RotorOf(geometry).clockwise = clockwise;
    ExpectAt(geometry, 0, 0, 0, {-1.5, -3.5, -1});
    ExpectAt(geometry, clockwise ? 3 : 1, 0, 0, {3.5, -1.5, -1});
  }
}

TEST(RotorTest, MirrorsFlipThePictureOnThePanel) {
  Geometry geometry =
      OnePanel(4, 8, 3, {.shift_u_mm = 2, .shift_v_mm = 0.5, .mirror_u = true, .mirror_v = true});
  ExpectAt(geometry, 0, 0, 0, {5.5, 0, 1.5});
  ExpectAt(geometry, 0, 7, 2, {-1.5, 0, -0.5});
}

TEST(RotorTest, PanelsTakeTurnsInTheNumbersOfSlices) {
  Geometry geometry;
  geometry.shape = Vortex(360);
  geometry.grid = DefaultGrid(geometry);
  EXPECT_EQ(SliceCount(geometry), 720);
  ExpectAt(geometry, 0, 0, 0, {-63.5, 13.5, -31.5});
  ExpectAt(geometry, 1, 0, 0, {63.5, -0.375, -31.5});    // half a turn later
  ExpectAt(geometry, 180, 0, 0, {-13.5, -63.5, -31.5});  // step 90
}

TEST(RotorTest, EachPassBelongsToOneSlice) {
  // A full diameter passes each column twice, half a turn apart, at u and its mirror image.
  Geometry geometry = OnePanel(360, 32, 1);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  // (3.5, 4.5): at atan(9/7) = 52.1°, 5.7 from the axis.
  const int32_t i = 16 + 3, j = 16 + 4;
  EXPECT_THAT(ReadFootprint(table, 52, 16 + 5, 0), Contains(Voxel(i, j, 0)));
  EXPECT_THAT(ReadFootprint(table, 232, 16 - 6, 0), Contains(Voxel(i, j, 0)));
  std::vector<int32_t> passes;
  for (int32_t s = 0; s < table.slices; ++s) {
    for (int32_t u = 0; u < table.width; ++u) {
      const Vec3 p = PixelPosition(geometry, s, u, 0);
      if (p.x >= 3 && p.x < 4 && p.y >= 4 && p.y < 5) continue;  // because it contains the centre
      if (ReadFootprint(table, s, u, 0).contains({i, j, 0})) passes.push_back(s);
    }
  }
  EXPECT_LE(passes.size(), 2u);
}

TEST(RotorTest, AnEdgeOfASliceBelongsToTheLater) {
  // The diagonal of a quarter turn is half-way between slices 0 and 1; opposite, between 2 and 3.
  Geometry geometry = OnePanel(4, 16, 1);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  const int32_t middle = geometry.grid.nx / 2;
  const auto voxel = Voxel(middle + 3, middle + 3, 0);  // 4.95 from the axis
  EXPECT_THAT(ReadFootprint(table, 0, 8 + 4, 0), Not(Contains(voxel)));
  EXPECT_THAT(ReadFootprint(table, 1, 8 + 4, 0), Contains(voxel));
  EXPECT_THAT(ReadFootprint(table, 2, 8 - 5, 0), Not(Contains(voxel)));
  EXPECT_THAT(ReadFootprint(table, 3, 8 - 5, 0), Contains(voxel));
}

TEST(RotorTest, ClockwiseEdgesBelongToTheLaterToo) {
  Geometry geometry = OnePanel(4, 16, 1);
  RotorOf(geometry).clockwise = true;
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  const int32_t middle = geometry.grid.nx / 2;
  // At 45° counter-clockwise: seven eighths of a clockwise turn, the end of slice 3 of 0 to 3.
  const auto voxel = Voxel(middle + 3, middle + 3, 0);
  EXPECT_THAT(ReadFootprint(table, 3, 8 + 4, 0), Not(Contains(voxel)));
  EXPECT_THAT(ReadFootprint(table, 0, 8 + 4, 0), Contains(voxel));
}

TEST(RotorTest, TheAxisIsInEverySliceOfAPanelThroughIt) {
  Geometry geometry = OnePanel(24, 9, 2);
  geometry.grid = CentredGrid(9, 9, 2, {1, 1, 1});
  for (const Sampling sampling : {Sampling::kMax, Sampling::kWeighted}) {
    const FootprintTable table = BuildFootprints(geometry, sampling);
    for (int32_t s = 0; s < 24; ++s) {
      EXPECT_THAT(ReadFootprint(table, s, 4, 0), Contains(Voxel(4, 4, 0))) << s;
      EXPECT_THAT(ReadFootprint(table, s, 4, 1), Contains(Voxel(4, 4, 1))) << s;
    }
  }
}

TEST(RotorTest, WhatLiesNearerToTheAxisThanThePlaneIsNotReached) {
  Geometry geometry = OnePanel(360, 16, 1, {.eccentricity_mm = 4});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  const std::vector<int32_t> weights = GreatestWeights(table, geometry.grid);
  const int32_t n = geometry.grid.nx;
  const auto weight = [&](int32_t i, int32_t j) {
    return weights[static_cast<size_t>((n / 2 + j) * n + n / 2 + i)];
  };
  EXPECT_EQ(weight(0, 0), 0);
  EXPECT_EQ(weight(1, 2), 0);    // 2.9 from the axis
  EXPECT_EQ(weight(4, 0), 255);  // 4.5
  EXPECT_EQ(weight(-1, 4), 255);
}

TEST(RotorTest, APanelThatComesAndGoesWithinASliceIsSeen) {
  // Barely beyond the plane's distance, both passes are in one slice: at its two edges the plane is
  // on the same side of the voxel.
  Geometry geometry = OnePanel(8, 16, 1, {.eccentricity_mm = 4.45});
  geometry.grid = CentredGrid(20, 21, 1, {1, 1, 1});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  // (4.5, 0): √(4.5² − 4.45²) = 0.67 along u either way, 8.5° about −90°; slice 6 has 22.5°.
  EXPECT_THAT(ReadFootprint(table, 6, 8, 0), Contains(Voxel(14, 10, 0)));
  EXPECT_THAT(ReadFootprint(table, 6, 7, 0), Contains(Voxel(14, 10, 0)));

  // At exactly the plane's distance there is one pass, at place 0 along u.
  std::get<Rotor>(geometry.shape).panels[0].eccentricity_mm = 4.5;
  const FootprintTable touched = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_THAT(ReadFootprint(touched, 6, 8, 0), Contains(Voxel(14, 10, 0)));
}

TEST(RotorTest, WeightsAreFullInTheNearerSliceAndPlaceTheVoxelBetweenBoth) {
  // Column (10.5, ½) is 2.726° further: 0.2726 of a slice of 36.
  Geometry geometry = OnePanel(36, 32, 1);
  geometry.grid = CentredGrid(32, 32, 1, {1, 1, 1});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kWeighted);
  const auto weight_in = [&](int32_t slice, int32_t u) {
    return ReadFootprint(table, slice, u, 0).at({26, 16, 0});
  };
  EXPECT_EQ(weight_in(0, 16 + 10), 255);
  EXPECT_EQ(weight_in(1, 16 + 10), 96);    // 255·0.2726/0.7274 = 95.6
  EXPECT_EQ(weight_in(18, 16 - 11), 255);  // half a turn later
  EXPECT_EQ(weight_in(19, 16 - 11), 96);
}

TEST(RotorTest, PanelsThatDifferAlongVHaveListsOfTheirOwn) {
  Geometry geometry = OnePanel(8, 6, 3);
  RotorOf(geometry).panels.push_back({.phase_turns = 0.5, .mirror_v = true});
  RotorOf(geometry).panels.push_back({.shift_v_mm = 1, .phase_turns = 0.25});
  geometry.grid = DefaultGrid(geometry);
  EXPECT_EQ(geometry.grid.nz, 4);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_EQ(table.inner_sets, 3);
  EXPECT_THAT(table.Inner(0, 0), ElementsAre(FootprintEntry{0, 0, 0}));
  EXPECT_THAT(table.Inner(1, 0), ElementsAre(FootprintEntry{0, 0, 2}));
  EXPECT_THAT(table.Inner(2, 0), ElementsAre(FootprintEntry{0, 0, 1}));
  EXPECT_THAT(table.Inner(3, 2), ElementsAre(FootprintEntry{0, 0, 2}));
  EXPECT_THAT(table.Inner(23, 2), ElementsAre(FootprintEntry{0, 0, 3}));
}

TEST(RotorTest, PanelsAlikeAlongVShareTheirLists) {
  Geometry geometry;
  geometry.shape = Vortex(12);
  geometry.grid = DefaultGrid(geometry);
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  EXPECT_EQ(table.inner_sets, 1);
  EXPECT_EQ(table.inner.begin.size(), 65u);
  EXPECT_THAT(table.inner.entries, Each(testing::Field(&FootprintEntry::weight, 255)));
}

// FNV-1a. Engines of one display on several machines build their tables separately.
uint64_t Digest(const FootprintLists& lists) {
  uint64_t hash = 0xCBF29CE484222325;
  const auto add = [&](uint64_t value) { hash = (hash ^ value) * 0x100000001B3; };
  for (const uint32_t begin : lists.begin) add(begin);
  for (const FootprintEntry& e : lists.entries) add(e.x), add(e.y), add(e.z), add(e.weight);
  return hash;
}

TEST(RotorTest, TablesAreTheSameOnEveryMachine) {
  Geometry geometry{Vortex(360), CentredGrid(128, 128, 64, {1, 1, 1})};
  EXPECT_EQ(Digest(BuildFootprints(geometry, Sampling::kMax).outer), 9552905415848629579u);
  EXPECT_EQ(Digest(BuildFootprints(geometry, Sampling::kWeighted).outer), 11921177043141669815u);
}

TEST(RotorTest, ALargeRotorsTableIsBuilt) {
  Geometry geometry = OnePanel(1024, 512, 64, {.eccentricity_mm = 0.5});
  const FootprintTable table = BuildFootprints(geometry, Sampling::kMax);
  // At least one column for each pixel, and at most that and two passes for each column.
  EXPECT_GE(table.outer.entries.size(), 1024u * 512u);
  EXPECT_LE(table.outer.entries.size(), 1024u * 512u + 2u * 514u * 514u);
}

}  // namespace rotor_test
}  // namespace voxeld::display
