#include "display/geometry/footprint.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <variant>

#include "display/geometry/corrector.h"
#include "display/geometry/flat_footprints.h"
#include "display/geometry/helix.h"
#include "display/geometry/lattice.h"
#include "display/geometry/planar_stack.h"
#include "display/geometry/rotor.h"

namespace voxeld::display {

int32_t SliceCount(const Geometry& geometry) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return static_cast<int32_t>(stack->positions_mm.size());
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) return LatticeSlices(*lattice);
  if (const auto* helix = std::get_if<Helix>(&geometry.shape)) return helix->slices_per_turn;
  const Rotor& rotor = std::get<Rotor>(geometry.shape);
  return rotor.slices_per_turn * static_cast<int32_t>(rotor.panels.size());
}

FootprintTable BuildFootprints(const Geometry& geometry, Sampling sampling) {
  if (IsFlat(geometry)) return BuildFlatFootprints(geometry, sampling);
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return BuildStackFootprints(*stack, geometry.grid, sampling);
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    if (!geometry.correction.has_value()) return BuildLatticeFootprints(*lattice, geometry.grid);
    const Corrector corrector(geometry.correction);
    Lattice moved = *lattice;
    for (std::optional<Vec3>& point : moved.points_mm) {
      if (point.has_value()) point = corrector.ToTrue(*point);
    }
    return BuildLatticeFootprints(moved, geometry.grid);
  }
  return BuildRotorFootprints(std::get<Rotor>(geometry.shape), geometry.grid, sampling);
}

namespace {

Vec3 StackPosition(const PlanarStack& stack, const Corrector& corrector, int32_t slice, int32_t u,
                   int32_t v) {
  const Vec3 at = StackPixelPosition(stack, slice, u, v);
  if (!corrector.moves_pictures()) return at;
  if (stack.normal == PlanarStack::Normal::kZ) {
    const PicturePlace p = corrector.PictureToTrue(slice, {at.x, at.y});
    return {p.u, p.v, at.z};
  }
  const PicturePlace p = corrector.PictureToTrue(slice, {at.x, at.z});
  return {p.u, at.y, p.v};
}

Vec3 HelixPosition(const Helix& helix, const Corrector& corrector, int32_t slice, int32_t u,
                   int32_t v) {
  const PicturePlace p =
      corrector.PictureToTrue(slice, {HelixRowU(helix).CentreMm(u), HelixRowV(helix).CentreMm(v)});
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const double square = p.u * p.u + p.v * p.v;
  const double unit = std::min(helix.pitch_u_mm, helix.pitch_v_mm);
  const std::optional<Fixed> x = ToFixedNear(p.u, unit), y = ToFixedNear(p.v, unit);
  if (!(square >= helix.hub_mm * helix.hub_mm && square < helix.radius_mm * helix.radius_mm) ||
      !x || !y) {
    return {kNone, kNone, kNone};
  }
  const double share =
      *x == 0 && *y == 0 ? 0.5 : BladeShare(helix, TurnOf(*x, *y), HelixTurn(helix, slice));
  if (share < 0) return {kNone, kNone, kNone};
  return {p.u, p.v, (share - 0.5) * helix.height_mm};
}

}  // namespace

Vec3 PixelPosition(const Geometry& geometry, int32_t slice, int32_t u, int32_t v) {
  const Corrector corrector(geometry.correction);
  return PixelPosition(geometry, corrector, slice, u, v);
}

Vec3 PixelPosition(const Geometry& geometry, const Corrector& corrector, int32_t slice, int32_t u,
                   int32_t v) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) {
    return corrector.ToTrue(StackPosition(*stack, corrector, slice, u, v));
  }
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) {
    return corrector.ToTrue(LatticePixelPosition(*lattice, slice, u));
  }
  if (const auto* helix = std::get_if<Helix>(&geometry.shape)) {
    return corrector.ToTrue(HelixPosition(*helix, corrector, slice, u, v));
  }
  return corrector.ToTrue(RotorPixelPosition(std::get<Rotor>(geometry.shape), slice, u, v));
}

}  // namespace voxeld::display
