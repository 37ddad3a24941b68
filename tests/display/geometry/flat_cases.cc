// Geometries whose footprints are stored pixel by pixel.
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include "display/geometry/footprint.h"
#include "display/geometry/keystone.h"
#include "display/geometry/motion.h"
#include "tests/display/geometry/geometry_cases.h"

namespace voxeld::display {
namespace {

template <typename Shape>
GeometryCase Case(std::string name, Shape shape, std::optional<Correction> correction = {}) {
  GeometryCase c{std::move(name), {std::move(shape), {}, std::move(correction)}};
  c.geometry.grid = DefaultGrid(c.geometry);
  return c;
}

PlanarStack Stack(PlanarStack::Normal normal) {
  PlanarStack stack;
  stack.normal = normal;
  stack.width_px = 22;
  stack.height_px = 17;
  stack.positions_mm = EvenPositions(11, 1.2);
  return stack;
}

// Turned by `angle` about an oblique axis, a little smaller and shifted.
Correction Turned(double angle) {
  Correction correction;
  const double c = std::cos(angle), s = std::sin(angle), k = std::cos(0.7 * angle),
               t = std::sin(0.7 * angle);
  correction.affine = {0.96 * c,     -0.96 * s,    0,         0.7,   //
                       0.97 * s * k, 0.97 * c * k, -0.97 * t, -0.4,  //
                       0.98 * s * t, 0.98 * c * t, 0.98 * k,  0.3};
  return correction;
}

Correction Bent(double mm, Vec3 half) {
  Correction correction;
  auto& grid = correction.displacement.emplace();
  grid = {3, 4, 3, {-half.x, -half.y, -half.z}, half, {}};
  for (int i = 0; i < 36; ++i) {
    grid.at_mm.push_back({mm * std::sin(i * 1.7), mm * std::cos(i * 2.3), mm * std::sin(i * 3.1)});
  }
  return correction;
}

}  // namespace

std::vector<GeometryCase> FlatCases() {
  std::vector<GeometryCase> cases;
  Rotor tilted;
  tilted.slices_per_turn = 150;
  tilted.width_px = 40;
  tilted.height_px = 18;
  tilted.panels = {{.eccentricity_mm = 2.25, .tilt_deg = 20}};
  cases.push_back(Case("TiltedPanel", tilted));
  tilted.panels.push_back({.eccentricity_mm = 0.4,
                           .shift_v_mm = 1.5,
                           .phase_turns = 0.41,
                           .mirror_u = true,
                           .mirror_v = true,
                           .tilt_deg = -12.5F});
  tilted.clockwise = true;
  cases.push_back(Case("TwoTiltedPanels", tilted));

  Helix helix;
  helix.slices_per_turn = 90;
  helix.width_px = 34;
  helix.height_px = 30;
  helix.radius_mm = 15;
  helix.height_mm = 24;
  cases.push_back(Case("Helix", helix));
  helix.blades = 3;
  helix.span_turns = 1.0 / 3;
  helix.hub_mm = 3.3;
  helix.left_handed = true;
  helix.clockwise = true;
  helix.phase_turns = 0.29;
  helix.mirror_u = true;
  cases.push_back(Case("HelixOfThreeBlades", helix));
  helix.blades = 2;
  helix.span_turns = 0.3;
  helix.left_handed = false;
  cases.push_back(Case("HelixWithGaps", helix));

  Correction keystone;
  const PicturePlace half = {11, 8.5};
  keystone.homographies.push_back(
      HomographyOfCorners(half, {{{-10, -8.2}, {11.5, -7.9}, {9.8, 8}, {-9.4, 9}}})->m);
  cases.push_back(Case("Keystone", Stack(PlanarStack::Normal::kZ), keystone));
  keystone.homographies.clear();
  for (int s = 0; s < 11; ++s) {
    const double grow = 1 - 0.02 * s, lean = 0.1 * s;
    keystone.homographies.push_back(
        HomographyOfCorners(
            half,
            {{{-11 * grow, -8.5}, {11 * grow, -8.5 + lean}, {11 - lean, 8.5}, {-11, 8.5 * grow}}})
            ->m);
  }
  cases.push_back(Case("KeystoneOfEachSlice", Stack(PlanarStack::Normal::kY), keystone));
  cases.push_back(Case("TurnedStack", Stack(PlanarStack::Normal::kZ), Turned(0.06)));
  cases.push_back(Case("BentStack", Stack(PlanarStack::Normal::kY), Bent(0.5, {11, 7, 9})));
  PlanarStack strokes = Stack(PlanarStack::Normal::kZ);
  strokes.strokes = 2;
  strokes.positions_mm = PositionsOf({.kind = Motion::Kind::kSine, .slices = 9, .travel_mm = 14});
  for (const double down :
       PositionsOf({.kind = Motion::Kind::kSine, .slices = 9, .travel_mm = 14, .down = true})) {
    strokes.positions_mm.push_back(down);
  }
  cases.push_back(Case("BentStrokes", strokes, Bent(0.4, {11, 9, 7})));
  Rotor small = Vortex(120);
  small.width_px = 48;
  small.height_px = 12;
  cases.push_back(Case("TurnedVortex", small, Turned(0.04)));
  helix.span_turns = 0.5;
  cases.push_back(Case("BentHelix", helix, Bent(0.4, {17, 17, 12})));
  return cases;
}

}  // namespace voxeld::display
