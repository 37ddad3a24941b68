// Compares the places that a page receives with the positions of pixels according to the geometry.
#include "daemon/viewer/pixel_places.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <variant>

#include "display/geometry/corrector.h"
#include "display/geometry/footprint.h"

namespace voxeld::daemon::viewer {
namespace {

using display::Geometry;
using display::Vec3;

Geometry Stack() {
  display::PlanarStack stack;
  stack.normal = display::PlanarStack::Normal::kY;
  stack.width_px = 7, stack.height_px = 5;
  stack.positions_mm = {-3, -1, 0.5, 4};
  Geometry geometry{.shape = stack};
  geometry.grid = display::DefaultGrid(geometry);
  return geometry;
}

Geometry Rotor() {
  display::Rotor rotor;
  rotor.slices_per_turn = 12, rotor.width_px = 8, rotor.height_px = 6;
  rotor.panels = {{.eccentricity_mm = 1.5}, {.eccentricity_mm = -0.5, .mirror_u = true}};
  Geometry geometry{.shape = rotor};
  geometry.grid = display::DefaultGrid(geometry);
  return geometry;
}

Geometry Tilted() {
  Geometry geometry = Rotor();
  std::get<display::Rotor>(geometry.shape).panels[0].tilt_deg = 20;
  return geometry;
}

Geometry Corrected() {
  Geometry geometry = Stack();
  geometry.correction.emplace();
  geometry.correction->affine = {1, 0.1, 0, 0.5, 0, 1, 0, 0, 0, 0, 0.9, -1};
  return geometry;
}

Geometry Helix() {
  display::Helix helix;
  helix.slices_per_turn = 10, helix.width_px = 12, helix.height_px = 12;
  helix.pitch_u_mm = helix.pitch_v_mm = 1;
  helix.blades = 1, helix.span_turns = 0.5, helix.height_mm = 8, helix.hub_mm = 1,
  helix.radius_mm = 5;
  Geometry geometry{.shape = helix};
  geometry.grid = display::DefaultGrid(geometry);
  return geometry;
}

class PlacesOf : public ::testing::TestWithParam<Geometry (*)()> {};

// Every pixel by itself: the only place that arrives is its own, within half a step.
TEST_P(PlacesOf, EveryPixel) {
  const Geometry geometry = GetParam()();
  ASSERT_TRUE(display::ValidateGeometry(geometry).ok()) << display::ValidateGeometry(geometry);
  PixelPlaces places(geometry);
  const display::Corrector corrector(geometry.correction);
  const PlaceBox& box = places.box();
  EXPECT_GT(places.pitch_mm(), 0);
  const auto width = static_cast<size_t>(places.width());
  size_t with_light = 0;
  for (int32_t slice = 0; slice < places.slices(); ++slice) {
    for (int32_t v = 0; v < places.height(); ++v) {
      for (int32_t u = 0; u < places.width(); ++u) {
        std::vector<uint8_t> rgb(width * static_cast<size_t>(places.height()) * 3);
        const size_t pixel = static_cast<size_t>(v) * width + static_cast<size_t>(u);
        rgb[pixel * 3 + 1] = 7;
        Points points;
        const size_t came = places.Append(slice, rgb, &points);
        const Vec3 at = display::PixelPosition(geometry, corrector, slice, u, v);
        ASSERT_EQ(came, std::isnan(at.x) ? 0u : 1u);
        if (came == 0) continue;
        ++with_light;
        const auto check = [](uint16_t place, double low, double high, double is) {
          const double step = (high - low) / kPlaceSteps;
          ASSERT_NEAR(low + place * step, is, 0.51 * step + 1e-5);
        };
        check(points.x[0], box.low_mm.x, box.high_mm.x, at.x);
        check(points.y[0], box.low_mm.y, box.high_mm.y, at.y);
        check(points.z[0], box.low_mm.z, box.high_mm.z, at.z);
        EXPECT_EQ(points.rgb, (std::vector<uint8_t>{0, 7, 0}));
      }
    }
  }
  EXPECT_GT(with_light, 0u);
}

TEST_P(PlacesOf, AllAtOnceInOrder) {
  const Geometry geometry = GetParam()();
  PixelPlaces places(geometry);
  const auto pixels = static_cast<size_t>(places.width()) * static_cast<size_t>(places.height());
  std::mt19937 random(3);
  std::vector<uint8_t> rgb(pixels * 3);
  for (size_t i = 0; i < pixels; ++i) {
    if (random() % 4 == 0) rgb[i * 3 + random() % 3] = static_cast<uint8_t>(1 + random() % 255);
  }
  Points all, singly;
  places.Append(0, rgb, &all);
  for (size_t i = 0; i < pixels; ++i) {
    std::vector<uint8_t> one(pixels * 3);
    std::copy_n(rgb.begin() + static_cast<std::ptrdiff_t>(i * 3), 3,
                one.begin() + static_cast<std::ptrdiff_t>(i * 3));
    places.Append(0, one, &singly);
  }
  EXPECT_EQ(all.x, singly.x);
  EXPECT_EQ(all.y, singly.y);
  EXPECT_EQ(all.z, singly.z);
  EXPECT_EQ(all.rgb, singly.rgb);
}

INSTANTIATE_TEST_SUITE_P(Geometries, PlacesOf,
                         ::testing::Values(&Stack, &Rotor, &Tilted, &Corrected, &Helix));

TEST(PixelPlaces, ALatticeHasItsLightsAlone) {
  display::Lattice lattice;
  lattice.width_px = 4;
  lattice.cell_mm = {1, 1, 1};
  lattice.points_mm.resize(8);
  lattice.points_mm[1] = {0, 0, 0};
  lattice.points_mm[6] = {3, -2, 5};
  Geometry geometry{.shape = lattice};
  geometry.grid = display::DefaultGrid(geometry);
  PixelPlaces places(geometry);
  Points points;
  const std::vector<uint8_t> white(12, 255);
  EXPECT_EQ(places.Append(0, white, &points), 1u);
  EXPECT_EQ(places.Append(1, white, &points), 1u);
  EXPECT_EQ(points.x, (std::vector<uint16_t>{0, kPlaceSteps}));
  EXPECT_EQ(points.y, (std::vector<uint16_t>{kPlaceSteps, 0}));
  const Points& dark = places.Sample();
  EXPECT_EQ(dark.size(), 2u);
  EXPECT_EQ(dark.rgb, std::vector<uint8_t>(6, 0));
}

}  // namespace
}  // namespace voxeld::daemon::viewer
