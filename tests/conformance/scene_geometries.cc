// The displays for which random scenes are drawn.
#include <algorithm>
#include <cstddef>
#include <optional>
#include <variant>

#include "display/geometry/footprint.h"
#include "tests/conformance/scene_generator.h"

namespace voxeld::gpu::conformance {

display::PlanarStack SceneGenerator::RandomStack() {
  display::PlanarStack stack;
  stack.normal = Chance(0.5) ? display::PlanarStack::Normal::kZ : display::PlanarStack::Normal::kY;
  stack.width_px = static_cast<int32_t>(Int(1, 40));
  stack.height_px = static_cast<int32_t>(Int(1, 40));
  stack.pitch_u_mm = Real(0.7, 1.5);
  stack.pitch_v_mm = Real(0.7, 1.5);
  double position = Real(-10, 0);
  for (int64_t n = Int(1, 30); n > 0; --n) {
    stack.positions_mm.push_back(position);
    position += Real(0.5, 2);
  }
  if (stack.positions_mm.size() % 2 == 0 && stack.positions_mm.size() > 2 && Chance(0.3)) {
    stack.strokes = 2;
    std::reverse(stack.positions_mm.begin() + static_cast<ptrdiff_t>(stack.positions_mm.size() / 2),
                 stack.positions_mm.end());
  }
  stack.mirror_u = Chance(0.3);
  return stack;
}

display::Rotor SceneGenerator::RandomRotor() {
  display::Rotor rotor;
  rotor.slices_per_turn = static_cast<int32_t>(Int(1, 40));
  rotor.width_px = static_cast<int32_t>(Int(2, 40));
  rotor.height_px = static_cast<int32_t>(Int(1, 40));
  rotor.panels.resize(static_cast<size_t>(Int(1, 2)));
  for (display::Rotor::Panel& panel : rotor.panels) {
    panel.eccentricity_mm = Chance(0.5) ? 0 : Real(-3, 3);
    panel.phase_turns = Chance(0.5) ? 0 : Real(0, 0.99);
    panel.shift_v_mm = Chance(0.7) ? 0 : Real(-5, 5);
    panel.mirror_u = Chance(0.2);
    panel.mirror_v = Chance(0.2);
    if (Chance(0.2)) panel.tilt_deg = static_cast<float>(Real(-40, 40));
  }
  rotor.clockwise = Chance(0.3);
  return rotor;
}

display::Helix SceneGenerator::RandomHelix() {
  display::Helix helix;
  helix.slices_per_turn = static_cast<int32_t>(Int(1, 40));
  helix.width_px = static_cast<int32_t>(Int(2, 40));
  helix.height_px = static_cast<int32_t>(Int(2, 40));
  helix.blades = static_cast<int32_t>(Int(1, 3));
  helix.span_turns = Chance(0.5) ? 1.0 / helix.blades : Real(0.1, 1.0 / helix.blades);
  helix.height_mm = Real(5, 30);
  helix.radius_mm = Real(4, 22);
  helix.hub_mm = Chance(0.5) ? 0 : Real(0, 3);
  helix.phase_turns = Real(0, 0.99);
  helix.left_handed = Chance(0.5);
  helix.clockwise = Chance(0.5);
  helix.mirror_v = Chance(0.3);
  return helix;
}

display::Correction SceneGenerator::RandomCorrection(const display::Geometry& geometry) {
  display::Correction correction;
  for (double& a : correction.affine) a += Real(-0.05, 0.05);
  if (Chance(0.5)) {
    display::DisplacementGrid& grid = correction.displacement.emplace();
    grid = {2, 3, 2, {-15, -15, -15}, {15, 15, 15}, {}};
    for (int i = 0; i < 12; ++i) grid.at_mm.push_back({Real(-1, 1), Real(-1, 1), Real(-1, 1)});
  }
  const bool projected = std::holds_alternative<display::PlanarStack>(geometry.shape) ||
                         std::holds_alternative<display::Helix>(geometry.shape);
  if (projected && Chance(0.5)) {
    correction.homographies.push_back({Real(0.9, 1.1), Real(-0.1, 0.1), Real(-1, 1),
                                       Real(-0.1, 0.1), Real(0.9, 1.1), Real(-1, 1),
                                       Real(-0.01, 0.01), Real(-0.01, 0.01), 1});
  }
  return correction;
}

// Returns lights in rows with gaps, or scattered ones.
display::Lattice SceneGenerator::RandomLattice() {
  display::Lattice lattice;
  lattice.width_px = static_cast<int32_t>(Int(1, 60));
  lattice.cell_mm = {Real(0.7, 1.5), Real(0.7, 1.5), Real(0.7, 1.5)};
  const int64_t pixels = lattice.width_px * Int(1, 30);
  const double gaps = Chance(0.5) ? 0 : Real(0, 0.7);
  const bool scattered = Chance(0.5);
  const int64_t nx = Int(1, 20), ny = Int(1, 20);
  for (int64_t n = 0; n < pixels; ++n) {
    display::Vec3 at;
    if (scattered) {
      at = {Real(-14, 14), Real(-14, 14), Real(-14, 14)};
    } else {
      at = {static_cast<double>(n % nx) * lattice.cell_mm.x,
            static_cast<double>(n / nx % ny) * lattice.cell_mm.y,
            static_cast<double>(n / nx / ny % 30) * lattice.cell_mm.z};
    }
    const bool gap = n > 0 && Chance(gaps);
    lattice.points_mm.push_back(gap ? std::nullopt : std::optional(at));
  }
  return lattice;
}

// Returns the grid; for a lattice also one that is finer or coarser than its lights, or beside
// them.
display::VoxelGrid SceneGenerator::RandomGrid(const display::Geometry& geometry) {
  display::VoxelGrid grid = display::DefaultGrid(geometry);
  if (!std::holds_alternative<display::Lattice>(geometry.shape) || Chance(0.5)) return grid;
  const double finer = Real(0.5, 1.5);
  for (int32_t* cells : {&grid.nx, &grid.ny, &grid.nz}) {
    *cells = std::clamp(static_cast<int32_t>(*cells * finer), 1, 45);
  }
  for (double* pitch : {&grid.pitch_mm.x, &grid.pitch_mm.y, &grid.pitch_mm.z}) *pitch /= finer;
  for (double* origin : {&grid.origin_mm.x, &grid.origin_mm.y, &grid.origin_mm.z}) {
    *origin += Chance(0.5) ? 0 : Real(-4, 4);
  }
  return grid;
}

}  // namespace voxeld::gpu::conformance
