#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <variant>
#include <vector>

#include "display/geometry/fixed_point.h"
#include "display/geometry/footprint.h"
#include "display/geometry/helix.h"
#include "display/geometry/lattice.h"
#include "display/geometry/planar_stack.h"
#include "display/geometry/rotor.h"

namespace voxeld::display {
namespace {

constexpr int64_t kMostUnevenCells = 4096;
constexpr double kEven = 1e-6;  // relative

// Returns the smallest number of cells that cover `length_mm`, up to rounding errors of doubles.
int32_t CellsOver(double length_mm, double pitch_mm) {
  const double cells = length_mm / pitch_mm;
  const int64_t rounded = RoundHalfUp(cells);
  const int64_t count = cells > static_cast<double>(rounded) + kEven ? rounded + 1 : rounded;
  return static_cast<int32_t>(
      std::clamp<int64_t>(count, 1, std::numeric_limits<int32_t>::max() - 1));
}

struct DepthCells {
  int32_t count;
  double pitch_mm, origin_mm;
};

DepthCells CellsAlong(const PlanarStack& stack) {
  const StackDepth ends = DepthOf(stack);
  const double depth = ends.high_mm - ends.low_mm;
  const std::vector<double>& p = stack.positions_mm;
  double least = depth, greatest = 0;
  const size_t of_stroke = p.size() / static_cast<size_t>(stack.strokes);
  for (size_t s = 1; s < p.size(); ++s) {
    if (s % of_stroke == 0) continue;
    least = std::min(least, std::abs(p[s] - p[s - 1]));
    greatest = std::max(greatest, std::abs(p[s] - p[s - 1]));
  }
  int64_t count = static_cast<int64_t>(p.size()) / stack.strokes;
  if (count > 1 && greatest - least > kEven * greatest) {
    // Limit it before the cast: the quotient may exceed any integer.
    const double wanted = std::min(depth / least, static_cast<double>(kMostUnevenCells));
    count = std::max<int64_t>(RoundHalfUp(wanted), 1);
  }
  return {static_cast<int32_t>(count), depth / static_cast<double>(count), ends.low_mm};
}

VoxelGrid StackGrid(const PlanarStack& stack) {
  const DepthCells along = CellsAlong(stack);
  const double origin_u = StackRowU(stack).PositionMm(0), origin_v = StackRowV(stack).PositionMm(0);
  if (stack.normal == PlanarStack::Normal::kZ) {
    return {stack.width_px,
            stack.height_px,
            along.count,
            {stack.pitch_u_mm, stack.pitch_v_mm, along.pitch_mm},
            {origin_u, origin_v, along.origin_mm}};
  }
  return {stack.width_px,
          along.count,
          stack.height_px,
          {stack.pitch_u_mm, along.pitch_mm, stack.pitch_v_mm},
          {origin_u, along.origin_mm, origin_v}};
}

VoxelGrid RotorGrid(const Rotor& rotor) {
  const double pitch_u = rotor.panels[0].pitch_u_mm, pitch_v = rotor.panels[0].pitch_v_mm;
  double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();
  for (const Rotor::Panel& panel : rotor.panels) {
    const PixelRow row = PanelRowV(rotor, panel);
    const double upright = LeanOf(panel).cos;
    low = std::min(low, row.PositionMm(0) * upright);
    high = std::max(high, row.PositionMm(2 * row.count) * upright);
  }
  const int32_t across = static_cast<int32_t>(std::min<int64_t>(
      2 * int64_t{CellsOver(RadiusMm(rotor), pitch_u)}, std::numeric_limits<int32_t>::max() - 1));
  return {across,
          across,
          CellsOver(high - low, pitch_v),
          {pitch_u, pitch_u, pitch_v},
          {-0.5 * across * pitch_u, -0.5 * across * pitch_u, low}};
}

VoxelGrid HelixGrid(const Helix& helix) {
  const auto across = [&](const PixelRow& row) {
    const double most = std::min(helix.radius_mm, row.PositionMm(2 * row.count));
    return 2 * CellsOver(most, row.pitch_mm);
  };
  const int32_t nx = across(HelixRowU(helix)), ny = across(HelixRowV(helix));
  const double rising = helix.slices_per_turn * helix.span_turns;
  const auto nz =
      static_cast<int32_t>(std::clamp<int64_t>(RoundHalfUp(rising), 1, kMostUnevenCells));
  return {nx,
          ny,
          nz,
          {helix.pitch_u_mm, helix.pitch_v_mm, helix.height_mm / nz},
          {-0.5 * nx * helix.pitch_u_mm, -0.5 * ny * helix.pitch_v_mm, -0.5 * helix.height_mm}};
}

VoxelGrid LatticeGrid(const Lattice& lattice) {
  const LightBounds lights = BoundsOf(lattice);
  const Vec3& cell = lattice.cell_mm;
  return {CellsOver(lights.high_mm.x - lights.low_mm.x + cell.x, cell.x),
          CellsOver(lights.high_mm.y - lights.low_mm.y + cell.y, cell.y),
          CellsOver(lights.high_mm.z - lights.low_mm.z + cell.z, cell.z),
          cell,
          {lights.low_mm.x - 0.5 * cell.x, lights.low_mm.y - 0.5 * cell.y,
           lights.low_mm.z - 0.5 * cell.z}};
}

}  // namespace

VoxelGrid DefaultGrid(const Geometry& geometry) {
  if (const auto* stack = std::get_if<PlanarStack>(&geometry.shape)) return StackGrid(*stack);
  if (const auto* lattice = std::get_if<Lattice>(&geometry.shape)) return LatticeGrid(*lattice);
  if (const auto* helix = std::get_if<Helix>(&geometry.shape)) return HelixGrid(*helix);
  return RotorGrid(std::get<Rotor>(geometry.shape));
}

}  // namespace voxeld::display
