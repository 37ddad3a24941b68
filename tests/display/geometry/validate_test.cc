#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "display/geometry/footprint.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Geometry GoodStack() {
  PlanarStack stack;
  stack.width_px = 16;
  stack.height_px = 12;
  stack.positions_mm = EvenPositions(8, 1);
  Geometry geometry{stack, {}};
  geometry.grid = DefaultGrid(geometry);
  return geometry;
}

Geometry GoodRotor() {
  Geometry geometry{Vortex(360), {}};
  geometry.grid = DefaultGrid(geometry);
  return geometry;
}

Geometry GoodLattice() {
  Geometry geometry{RegularLattice(4, 3, 2, {1, 1, 1}), {}};
  std::get<Lattice>(geometry.shape).points_mm[5] = std::nullopt;
  geometry.grid = DefaultGrid(geometry);
  return geometry;
}

template <typename Shape>
struct BadCase {
  std::function<void(Shape&, VoxelGrid&)> spoil;
  std::vector<std::string> words;
};

template <typename Shape>
void ExpectRefused(const Geometry& good, const std::vector<BadCase<Shape>>& cases) {
  ASSERT_TRUE(ValidateGeometry(good).ok()) << ValidateGeometry(good);
  for (const BadCase<Shape>& c : cases) {
    Geometry bad = good;
    c.spoil(std::get<Shape>(bad.shape), bad.grid);
    const absl::Status status = ValidateGeometry(bad);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << c.words[0];
    for (const std::string& word : c.words) {
      EXPECT_THAT(std::string(status.message()), testing::HasSubstr(word));
    }
  }
}

TEST(ValidateTest, Stacks) {
  using G = VoxelGrid;
  using S = PlanarStack;
  ExpectRefused<S>(
      GoodStack(),
      {
          {[](S& s, G&) { s.normal = static_cast<S::Normal>(7); },
           {"normal is 7", "kZ (0) or kY (1)"}},
          {[](S& s, G&) { s.width_px = 0; }, {"width_px is 0", "1 to 16384"}},
          {[](S& s, G&) { s.width_px = -5; }, {"width_px is -5"}},
          {[](S& s, G&) { s.height_px = 16385; }, {"height_px is 16385", "1 to 16384"}},
          {[](S& s, G&) { s.pitch_u_mm = 0; }, {"pitch_u_mm is 0", "0.0001 to 10000 mm"}},
          {[](S& s, G&) { s.pitch_u_mm = kNan; }, {"pitch_u_mm is nan"}},
          {[](S& s, G&) { s.pitch_v_mm = kInfinity; }, {"pitch_v_mm is inf"}},
          {[](S& s, G&) { s.pitch_v_mm = -1; }, {"pitch_v_mm is -1"}},
          {[](S& s, G&) { s.positions_mm.clear(); }, {"positions_mm is 0", "1 to 16384"}},
          {[](S& s, G&) { s.positions_mm = EvenPositions(16385, 1); }, {"positions_mm is 16385"}},
          {[](S& s, G&) { s.positions_mm[3] = kNan; }, {"positions_mm[3] is nan"}},
          {[](S& s, G&) { s.positions_mm[7] = 2e6; }, {"positions_mm[7] is 2000000", "1000000 mm"}},
          {[](S& s, G&) { s.positions_mm[2] = s.positions_mm[1]; },
           {"positions_mm[2] is -2.5", "above positions_mm[1], -2.5",
            "ascend or descend strictly within a stroke"}},
          {[](S& s, G&) { s.positions_mm[2] = s.positions_mm[1] + 1e-6; },
           {"positions_mm[2] − positions_mm[1] is 1e-06", "1/1024", "0.000976562 mm"}},
          {[](S& s, G&) { s.positions_mm = {0}, s.thickness_mm = 0; }, {"thickness_mm is 0"}},
          {[](S& s, G&) { s.positions_mm = {0}, s.thickness_mm = kNan; }, {"thickness_mm is nan"}},
          {[](S& s, G&) {
             s.width_px = s.height_px = 16384;
             s.positions_mm = EvenPositions(65, 1);
           },
           {"slices·width_px·height_px (65·16384·16384) is 17448304640", "at most 17179869184"}},
          {[](S& s, G& g) {
             s.width_px = g.nx = 16384;
             g.nz = 8192;
           },
           {"footprint table is 537133056", "at most 268435456", "coarser grid"}},
          {[](S&, G& g) { g.nx = 0; }, {"grid.nx is 0", "1 to 16384"}},
          {[](S&, G& g) { g.ny = 65536; }, {"grid.ny is 65536"}},
          {[](S&, G& g) { g.nz = -1; }, {"grid.nz is -1"}},
          {[](S&, G& g) { g.pitch_mm.x = 0; }, {"grid.pitch_mm.x is 0"}},
          {[](S&, G& g) { g.pitch_mm.y = kNan; }, {"grid.pitch_mm.y is nan"}},
          {[](S&, G& g) { g.pitch_mm.z = 1e5; }, {"grid.pitch_mm.z is 100000"}},
          {[](S&, G& g) { g.origin_mm.x = kNan; }, {"grid.origin_mm.x is nan"}},
          {[](S&, G& g) { g.origin_mm.y = -kInfinity; }, {"grid.origin_mm.y is -inf"}},
          {[](S&, G& g) { g.origin_mm.z = 1e7; }, {"grid.origin_mm.z is 10000000"}},
          {[](S&, G& g) { g.nx = g.ny = g.nz = 16384; },
           {"grid.nx·ny·nz (16384·16384·16384) is 4398046511104", "at most 68719476736"}},
      });
}

TEST(ValidateTest, Rotors) {
  using G = VoxelGrid;
  using R = Rotor;
  ExpectRefused<R>(
      GoodRotor(),
      {
          {[](R& r, G&) { r.slices_per_turn = 0; }, {"slices_per_turn is 0", "1 to 16384"}},
          {[](R& r, G&) { r.slices_per_turn = std::numeric_limits<int32_t>::max(); },
           {"slices_per_turn is 2147483647"}},
          {[](R& r, G&) { r.width_px = 0; }, {"width_px is 0"}},
          {[](R& r, G&) { r.height_px = -1; }, {"height_px is -1"}},
          {[](R& r, G&) { r.panels.clear(); }, {"panels is 0", "1 to 16"}},
          {[](R& r, G&) { r.panels.resize(17); }, {"panels is 17"}},
          {[](R& r, G&) { r.panels[1].pitch_u_mm = kNan; }, {"panels[1].pitch_u_mm is nan"}},
          {[](R& r, G&) { r.panels[0].pitch_v_mm = -2; }, {"panels[0].pitch_v_mm is -2"}},
          {[](R& r, G&) { r.panels[1].eccentricity_mm = kInfinity; },
           {"panels[1].eccentricity_mm is inf"}},
          {[](R& r, G&) { r.panels[0].shift_u_mm = kNan; }, {"panels[0].shift_u_mm is nan"}},
          {[](R& r, G&) { r.panels[0].shift_v_mm = -1e7; }, {"panels[0].shift_v_mm is -10000000"}},
          {[](R& r, G&) { r.panels[1].phase_turns = 1; },
           {"panels[1].phase_turns is 1", "at least 0 and below 1"}},
          {[](R& r, G&) { r.panels[1].phase_turns = -0.25; }, {"panels[1].phase_turns is -0.25"}},
          {[](R& r, G&) { r.panels[1].phase_turns = kNan; }, {"panels[1].phase_turns is nan"}},
          {[](R& r, G&) {
             r.slices_per_turn = 16384;
             r.width_px = 1024;
             r.height_px = 1024;
           },
           {"slices·width_px·height_px (32768·1024·1024) is 34359738368"}},
          {[](R& r, G&) { r.panels[0].eccentricity_mm = 20000; },
           {"panels' greatest distance from the axis is 20000", "within 16384 mm"}},
          {[](R&, G& g) { g.origin_mm.x = -17000; }, {"grid.origin_mm.x is -17000"}},
          {[](R&, G& g) { g.origin_mm.y = 17000; }, {"grid.origin_mm.y is 17000"}},
          {[](R&, G& g) { g.origin_mm.x = 16300; }, {"far end along x is 16432"}},
          {[](R&, G& g) { g.pitch_mm.y = 200, g.origin_mm.y = 0; }, {"far end along y is 26400"}},
          {[](R&, G& g) { g.nx = g.ny = 8192; }, {"footprint table is", "at most 268435456"}},
      });
}

TEST(ValidateTest, Lattices) {
  using G = VoxelGrid;
  using L = Lattice;
  ExpectRefused<L>(
      GoodLattice(),
      {
          {[](L& l, G&) { l.width_px = 0; }, {"width_px is 0", "1 to 16384"}},
          {[](L& l, G&) { l.width_px = -1; }, {"width_px is -1"}},
          {[](L& l, G&) { l.width_px = 16385; }, {"width_px is 16385"}},
          {[](L& l, G&) { l.height_px = 2; }, {"height_px is 2", "must be 1"}},
          {[](L& l, G&) { l.height_px = 0; }, {"height_px is 0"}},
          {[](L& l, G&) { l.points_mm.pop_back(); },
           {"the number of points_mm is 23", "a multiple of width_px, 12"}},
          {[](L& l, G&) { l.points_mm.clear(); }, {"points_mm / width_px is 0", "1 to 16384"}},
          {[](L& l, G&) {
             l.width_px = 1;
             l.points_mm.resize(16385);
           },
           {"points_mm / width_px is 16385"}},
          {[](L& l, G&) {
             l.width_px = 16384;
             l.points_mm.resize(1025 * 16384);
           },
           {"the number of points_mm is 16793600", "at most 16777216"}},
          {[](L& l, G&) { l.points_mm.assign(24, std::nullopt); },
           {"points_mm that have a light is 0", "1 at least"}},
          {[](L& l, G&) { l.points_mm[3]->x = kNan; }, {"points_mm[3].x is nan", "1000000 mm"}},
          {[](L& l, G&) { l.points_mm[4]->y = kInfinity; }, {"points_mm[4].y is inf"}},
          {[](L& l, G&) { l.points_mm[23]->z = -2e6; }, {"points_mm[23].z is -2000000"}},
          {[](L& l, G&) { l.cell_mm.x = 0; }, {"cell_mm.x is 0", "0.0001 to 10000 mm"}},
          {[](L& l, G&) { l.cell_mm.y = kNan; }, {"cell_mm.y is nan"}},
          {[](L& l, G&) { l.cell_mm.z = -1; }, {"cell_mm.z is -1"}},
          {[](L&, G& g) { g.nz = 0; }, {"grid.nz is 0"}},
          {[](L& l, G& g) {
             l.cell_mm = {1e4, 1e4, 1e4};
             g.nx = g.ny = g.nz = 1024;
           },
           {"footprint table is 24696061975", "at most 268435456"}},
      });
}

TEST(ValidateTest, TheShapeAloneNeedsNoGrid) {
  Geometry geometry = GoodRotor();
  geometry.grid = {};
  EXPECT_TRUE(ValidateShape(geometry).ok());
  EXPECT_FALSE(ValidateGeometry(geometry).ok());
  std::get<Rotor>(geometry.shape).width_px = 0;
  EXPECT_FALSE(ValidateShape(geometry).ok());
}

TEST(ValidateTest, TheFirstFaultIsTold) {
  Geometry geometry = GoodStack();
  std::get<PlanarStack>(geometry.shape).height_px = 0;
  geometry.grid.nx = 0;
  EXPECT_THAT(std::string(ValidateGeometry(geometry).message()),
              testing::StartsWith("height_px is 0: it must be from 1 to 16384"));
}

// At the limits, all sums must fit in 64 bits; UBSan checks that.
TEST(ValidateTest, WhatIsAtTheLimitsIsBuilt) {
  Geometry stack = GoodStack();
  auto& s = std::get<PlanarStack>(stack.shape);
  s.positions_mm = {-1e6, 1e6};
  s.pitch_u_mm = s.pitch_v_mm = 1e4;
  s.width_px = 4000;
  stack.grid = {4, 4, 16384, {1e-4, 1e-4, 1e-4}, {1e6, -1e6, 1e6 - 1}};
  ASSERT_TRUE(ValidateGeometry(stack).ok()) << ValidateGeometry(stack);
  EXPECT_FALSE(BuildFootprints(stack, Sampling::kWeighted).outer.entries.empty());

  Geometry rotor{Vortex(3), CentredGrid(16384, 8, 2, {1, 4000, 10000})};
  auto& r = std::get<Rotor>(rotor.shape);
  r.panels[0] = {.pitch_u_mm = 120, .eccentricity_mm = -14000};
  r.panels[1] = {.pitch_u_mm = 250, .pitch_v_mm = 1e4, .shift_u_mm = 300, .shift_v_mm = 1e6};
  rotor.grid.origin_mm.x = -16384;
  ASSERT_TRUE(ValidateGeometry(rotor).ok()) << ValidateGeometry(rotor);
  const FootprintTable table = BuildFootprints(rotor, Sampling::kWeighted);
  EXPECT_FALSE(table.outer.entries.empty());

  Geometry lattice{Lattice{.width_px = 2, .points_mm = {Vec3{1e6, -1e6, 1e6}, Vec3{-1e6, 1e6, 0}}},
                   {4, 4, 16384, {1e-4, 1e-4, 1e-4}, {1e6, -1e6, 1e6 - 1}}};
  std::get<Lattice>(lattice.shape).cell_mm = {1e4, 1e-4, 1e4};
  ASSERT_TRUE(ValidateGeometry(lattice).ok()) << ValidateGeometry(lattice);
  EXPECT_FALSE(BuildFootprints(lattice, Sampling::kMax).outer.entries.empty());
}

TEST(ValidateTest, Helices) {
  Helix helix;
  helix.slices_per_turn = 20;
  helix.width_px = helix.height_px = 16;
  helix.blades = 2;
  helix.span_turns = 0.5;
  helix.height_mm = 10;
  helix.hub_mm = 1;
  helix.radius_mm = 8;
  Geometry good{helix, {}};
  good.grid = DefaultGrid(good);
  ExpectRefused<Helix>(
      good,
      {{[](Helix& h, VoxelGrid&) { h.slices_per_turn = 0; }, {"slices_per_turn is 0"}},
       {[](Helix& h, VoxelGrid&) { h.blades = 11; }, {"blades is 11", "from 1 to 10"}},
       {[](Helix& h, VoxelGrid&) { h.span_turns = 0.6; }, {"span_turns is 0.6", "1 / blades, 0.5"}},
       {[](Helix& h, VoxelGrid&) { h.span_turns = 0.05; }, {"span_turns is 0.05", "from 0.1"}},
       {[](Helix& h, VoxelGrid&) { h.height_mm = 0; }, {"height_mm is 0"}},
       {[](Helix& h, VoxelGrid&) { h.hub_mm = 8; }, {"hub_mm is 8", "below radius_mm"}},
       {[](Helix& h, VoxelGrid&) { h.radius_mm = NAN; }, {"radius_mm is nan"}},
       {[](Helix& h, VoxelGrid&) { h.phase_turns = 1; }, {"phase_turns is 1"}},
       {[](Helix& h, VoxelGrid&) { h.phase_turns = -0.25; }, {"phase_turns is -0.25"}},
       {[](Helix& h, VoxelGrid&) { h.width_px = h.height_px = h.slices_per_turn = 1024; },
        {"at most 134217728", "pixel by pixel"}}});
}

TEST(ValidateTest, StrokesAreOneOrTwo) {
  for (const int strokes : {-1, 0, 3}) {
    Geometry bad = GoodStack();
    std::get<PlanarStack>(bad.shape).strokes = strokes;
    const absl::Status status = ValidateGeometry(bad);
    EXPECT_THAT(std::string(status.message()), testing::HasSubstr("must be 1 or 2")) << strokes;
  }
}

TEST(ValidateTest, ACorrectionIsAskedForWithTheGridToo) {
  Geometry bad = GoodStack();
  bad.correction.emplace();
  bad.correction->affine[0] = NAN;
  EXPECT_EQ(ValidateGeometry(bad).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ValidateGeometry(bad), ValidateShape(bad));
}

TEST(ValidateTest, TiltsAndAxes) {
  Rotor rotor;
  rotor.slices_per_turn = 16384;
  rotor.width_px = 8;
  rotor.height_px = 1;
  rotor.panels.resize(16);
  for (Rotor::Panel& panel : rotor.panels) panel.pitch_v_mm = 9000;
  Geometry geometry{rotor, {1, 1, 16384, {1, 1, 0.5}, {-0.5, -0.5, -4096}}, Correction{}};
  // Each of its voxels is on the axis, in every slice.
  EXPECT_THAT(std::string(ValidateGeometry(geometry).message()),
              testing::HasSubstr("the bound on the footprint table"));
  rotor.panels.resize(1);
  rotor.panels[0].tilt_deg = -61;
  EXPECT_THAT(std::string(ValidateShape({rotor, {}}).message()),
              testing::HasSubstr("panels[0].tilt_deg is -61"));
}

TEST(Validate, FormatsThatDoNotGoTogetherAreRefused) {
  const auto refusal = [](FrameLayout layout) {
    return std::string(ValidateFormat(layout).message());
  };
  EXPECT_TRUE(ValidateFormat({.height = 2, .format = PixelFormat::kHub75, .bits = 8}).ok());
  EXPECT_EQ(refusal({.height = 3, .format = PixelFormat::kHub75}),
            "layout.height is 3, must be even, as hub75 has");
  EXPECT_EQ(refusal({.format = PixelFormat::kRgb332, .bits = 2}),
            "layout.bits is 2, must be 0 or 3, as rgb332 has");
  EXPECT_EQ(refusal({.format = PixelFormat::kPlanes24, .bits = 8}),
            "layout.bits is 8, must be 0 or 1, as planes24 has");
  EXPECT_EQ(refusal({.bits = 9}), "layout.bits is 9, must be 0 to 8");
  EXPECT_EQ(refusal({.bits = -1}), "layout.bits is -1, must be 0 to 8");
  EXPECT_TRUE(ValidateFormat({.format = PixelFormat::kRgb332, .bits = 3}).ok());
  EXPECT_TRUE(ValidateFormat({.format = PixelFormat::kRgb332, .bits = 0}).ok());
  EXPECT_TRUE(ValidateFormat({.format = PixelFormat::kPlanes24, .bits = 1}).ok());
  EXPECT_TRUE(ValidateFormat({.format = PixelFormat::kPlanes24, .bits = 0}).ok());
  EXPECT_EQ(refusal({.format = static_cast<PixelFormat>(5)}), "layout.format is 5, must be 0 to 4");
}

}  // namespace
}  // namespace voxeld::display
