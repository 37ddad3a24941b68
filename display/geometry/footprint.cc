#include "display/geometry/footprint.h"

#include <variant>

#include "display/geometry/lattice.h"
#include "display/geometry/planar_stack.h"
#include "display/geometry/rotor.h"

namespace voxeld::display {

int32_t SliceCount(const Geometry& geometry) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return static_cast<int32_t>(stack->positions_mm.size());
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) return LatticeSlices(*lattice);
  const Rotor& rotor = std::get<Rotor>(geometry.shape);
  return rotor.slices_per_turn * static_cast<int32_t>(rotor.panels.size());
}

FootprintTable BuildFootprints(const Geometry& geometry, Sampling sampling) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return BuildStackFootprints(*stack, geometry.grid, sampling);
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    return BuildLatticeFootprints(*lattice, geometry.grid);
  }
  return BuildRotorFootprints(std::get<Rotor>(geometry.shape), geometry.grid, sampling);
}

Vec3 PixelPosition(const Geometry& geometry, int32_t slice, int32_t u, int32_t v) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return StackPixelPosition(*stack, slice, u, v);
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    return LatticePixelPosition(*lattice, slice, u);
  }
  return RotorPixelPosition(std::get<Rotor>(geometry.shape), slice, u, v);
}

}  // namespace voxeld::display
