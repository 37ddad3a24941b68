#include "tests/display/geometry/geometry_cases.h"

#include <utility>

#include "display/geometry/footprint.h"

namespace voxeld::display {
namespace {

template <typename Shape>
GeometryCase WithDefaultGrid(std::string name, Shape shape) {
  GeometryCase c{std::move(name), {std::move(shape), {}}};
  c.geometry.grid = DefaultGrid(c.geometry);
  return c;
}

template <typename Shape>
GeometryCase WithGrid(std::string name, Shape shape, VoxelGrid grid) {
  return {std::move(name), {std::move(shape), grid}};
}

PlanarStack StackAt(int width, int height, std::vector<double> positions) {
  PlanarStack stack;
  stack.width_px = width;
  stack.height_px = height;
  stack.positions_mm = std::move(positions);
  return stack;
}

Rotor OnePanel(int slices_per_turn, int width, int height, Rotor::Panel panel = {}) {
  Rotor rotor;
  rotor.slices_per_turn = slices_per_turn;
  rotor.width_px = width;
  rotor.height_px = height;
  rotor.panels = {panel};
  return rotor;
}

}  // namespace

std::vector<double> EvenPositions(int count, double spacing_mm, double middle_mm) {
  std::vector<double> positions;
  for (int s = 0; s < count; ++s) {
    positions.push_back(middle_mm + (s + 0.5 - 0.5 * count) * spacing_mm);
  }
  return positions;
}

VoxelGrid CentredGrid(int nx, int ny, int nz, Vec3 pitch_mm) {
  return {nx,
          ny,
          nz,
          pitch_mm,
          {-0.5 * nx * pitch_mm.x, -0.5 * ny * pitch_mm.y, -0.5 * nz * pitch_mm.z}};
}

Rotor Vortex(int slices_per_turn) {
  Rotor rotor = OnePanel(slices_per_turn, 128, 64, {.eccentricity_mm = 13.5});
  rotor.panels.push_back({.eccentricity_mm = 0.375, .phase_turns = 0.5});
  return rotor;
}

std::vector<GeometryCase> StackCases() {
  std::vector<GeometryCase> cases;
  const PlanarStack even = StackAt(24, 18, EvenPositions(12, 1));
  cases.push_back(WithDefaultGrid("Even", even));

  PlanarStack standing = StackAt(24, 18, EvenPositions(12, 1.5, 4));
  standing.normal = PlanarStack::Normal::kY;
  cases.push_back(WithDefaultGrid("Standing", standing));

  const PlanarStack listed = StackAt(10, 9, {-7, -6.25, -3, -2.875, 0.5, 4, 4.75, 9});
  cases.push_back(WithDefaultGrid("Listed", listed));
  cases.push_back(WithGrid("ListedCoarseGrid", listed, CentredGrid(5, 4, 3, {2.1, 2.3, 6})));

  cases.push_back(WithGrid("CoarserGrid", even, CentredGrid(9, 7, 5, {2.7, 2.6, 2.45})));
  cases.push_back(WithGrid("FinerGrid", even, CentredGrid(61, 48, 40, {0.4, 0.37, 0.3})));
  cases.push_back(WithGrid("TwiceFinerGrid", even, CentredGrid(48, 36, 24, {0.5, 0.5, 0.5})));

  PlanarStack oblong = StackAt(31, 17, EvenPositions(9, 0.9));
  oblong.pitch_u_mm = 0.31;
  oblong.pitch_v_mm = 0.47;
  oblong.mirror_u = true;
  cases.push_back(WithDefaultGrid("OblongMirrored", oblong));
  cases.push_back(
      WithGrid("OblongMirroredUnevenGrid", oblong, CentredGrid(40, 20, 11, {0.26, 0.51, 0.77})));

  standing.mirror_v = true;
  VoxelGrid beside = CentredGrid(20, 30, 25, {1.1, 0.8, 1.3});
  beside.origin_mm = {-4.05, -9.85, -6.65};
  cases.push_back(WithGrid("StandingGridBesidePicture", standing, beside));

  cases.push_back(WithGrid("DenserThanVoxels", StackAt(8, 8, EvenPositions(40, 0.23)),
                           CentredGrid(8, 8, 10, {1, 1, 1})));
  PlanarStack strokes = StackAt(11, 9, {4, 2.5, 1.25, 0, -2, -2, 0.5, 1, 3, 4.5});
  strokes.strokes = 2;
  cases.push_back(WithDefaultGrid("TwoStrokes", strokes));
  cases.push_back(WithGrid("Descending", StackAt(10, 9, {6, 3, 2.5, -1, -4}),
                           CentredGrid(10, 9, 13, {1, 1, 1})));
  PlanarStack single = StackAt(12, 10, {2});
  single.thickness_mm = 5.3;
  cases.push_back(WithGrid("SingleSlice", single, CentredGrid(12, 10, 16, {1, 1, 1})));
  return cases;
}

std::vector<GeometryCase> RotorCases() {
  std::vector<GeometryCase> cases;
  for (const int slices : {120, 360, 720}) {
    const std::string suffix = std::to_string(slices);
    cases.push_back(WithDefaultGrid("OnAxis" + suffix, OnePanel(slices, 64, 16)));
    cases.push_back(WithDefaultGrid("Vortex" + suffix, Vortex(slices)));
  }
  cases.push_back(WithGrid("VortexGivenGrid", Vortex(360), CentredGrid(128, 128, 64, {1, 1, 1})));
  for (const int slices : {1, 2, 3, 4, 7}) {
    const std::string suffix = std::to_string(slices);
    cases.push_back(
        WithDefaultGrid("FewSlices" + suffix, OnePanel(slices, 20, 4, {.eccentricity_mm = 3.25})));
  }
  cases.push_back(WithDefaultGrid("Outside", OnePanel(200, 48, 8, {.eccentricity_mm = 5.5})));
  cases.push_back(
      WithDefaultGrid("OutsideBehind", OnePanel(200, 48, 8, {.eccentricity_mm = -5.5})));

  Rotor clockwise = Vortex(240);
  clockwise.clockwise = true;
  clockwise.panels[0].phase_turns = 0.137;
  clockwise.panels[1].phase_turns = 0.9;
  clockwise.width_px = 51;
  clockwise.height_px = 11;
  cases.push_back(WithDefaultGrid("ClockwiseOddWidth", clockwise));

  Rotor mirrored = OnePanel(150, 33, 9,
                            {.eccentricity_mm = 2.2,
                             .shift_u_mm = 3.7,
                             .shift_v_mm = -1.3,
                             .phase_turns = 0.61,
                             .mirror_u = true,
                             .mirror_v = true});
  cases.push_back(WithDefaultGrid("ShiftedMirrored", mirrored));
  cases.push_back(WithDefaultGrid("HalfPanel", OnePanel(300, 32, 6, {.shift_u_mm = 16})));

  Rotor unlike =
      OnePanel(180, 40, 12, {.pitch_u_mm = 0.5, .pitch_v_mm = 0.6, .eccentricity_mm = 1});
  unlike.panels.push_back({.pitch_u_mm = 0.7,
                           .pitch_v_mm = 0.45,
                           .eccentricity_mm = -2,
                           .shift_v_mm = 1.4,
                           .phase_turns = 0.3,
                           .mirror_v = true});
  cases.push_back(WithDefaultGrid("UnlikePanels", unlike));
  cases.push_back(
      WithGrid("UnlikePanelsUnevenGrid", unlike, CentredGrid(52, 37, 21, {0.61, 0.83, 0.55})));

  cases.push_back(
      WithGrid("OddGridOnAxis", OnePanel(90, 41, 5), CentredGrid(41, 41, 5, {1, 1, 1})));
  cases.push_back(WithGrid("CoarseGrid", Vortex(360), CentredGrid(47, 47, 23, {2.8, 2.8, 2.8})));
  VoxelGrid beside = CentredGrid(40, 30, 10, {1, 1.2, 0.9});
  beside.origin_mm = {-7.3, 2.9, -4.1};
  cases.push_back(
      WithGrid("GridBesideAxis", OnePanel(360, 64, 8, {.eccentricity_mm = 1.5}), beside));
  return cases;
}

std::vector<GeometryCase> AllCases() {
  std::vector<GeometryCase> cases = StackCases();
  for (GeometryCase& c : RotorCases()) cases.push_back(std::move(c));
  for (GeometryCase& c : LatticeCases()) cases.push_back(std::move(c));
  return cases;
}

}  // namespace voxeld::display
