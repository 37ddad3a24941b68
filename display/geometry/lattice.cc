#include "display/geometry/lattice.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>

#include "display/geometry/cells.h"
#include "display/geometry/fixed_point.h"
#include "display/geometry/list_builder.h"

namespace voxeld::display {
namespace {

// The cells of a light on one axis of the grid.
struct LightCells {
  CellRange box;  // cells whose centres lie in its box
  int32_t own;    // the cell that contains it; −1: it lies outside the grid
};

class CellAxis {
 public:
  CellAxis(int32_t cells, double pitch_mm, double origin_mm, double cell_mm)
      : cells_(cells),
        pitch_mm_(pitch_mm),
        origin_mm_(origin_mm),
        extent_(ToFixed(cell_mm, pitch_mm)) {}

  LightCells CellsOf(double light_mm) const {
    const Fixed at = ToFixed(light_mm - origin_mm_, pitch_mm_);
    const Fixed own = at >> kFixedBits;
    return {CellsBetween(2 * at - extent_, 2 * at + extent_, cells_),
            own >= 0 && own < cells_ ? static_cast<int32_t>(own) : -1};
  }

 private:
  const int32_t cells_;
  const double pitch_mm_, origin_mm_;
  const Fixed extent_;  // size of a light's box
};

FootprintEntry EntryAt(int32_t x, int32_t y, int32_t z) {
  return {static_cast<uint16_t>(x), static_cast<uint16_t>(y), static_cast<uint16_t>(z)};
}

}  // namespace

int32_t LatticeSlices(const Lattice& lattice) {
  return static_cast<int32_t>(lattice.points_mm.size() / static_cast<size_t>(lattice.width_px));
}

LightBounds BoundsOf(const Lattice& lattice) {
  constexpr double kLeast = std::numeric_limits<double>::lowest();
  constexpr double kMost = std::numeric_limits<double>::max();
  LightBounds bounds{{kMost, kMost, kMost}, {kLeast, kLeast, kLeast}};
  for (const std::optional<Vec3>& point : lattice.points_mm) {
    if (!point.has_value()) continue;
    Vec3& low = bounds.low_mm;
    Vec3& high = bounds.high_mm;
    low = {std::min(low.x, point->x), std::min(low.y, point->y), std::min(low.z, point->z)};
    high = {std::max(high.x, point->x), std::max(high.y, point->y), std::max(high.z, point->z)};
  }
  return bounds;
}

FootprintTable BuildLatticeFootprints(const Lattice& lattice, const VoxelGrid& grid) {
  const CellAxis axis_x(grid.nx, grid.pitch_mm.x, grid.origin_mm.x, lattice.cell_mm.x);
  const CellAxis axis_y(grid.ny, grid.pitch_mm.y, grid.origin_mm.y, lattice.cell_mm.y);
  const CellAxis axis_z(grid.nz, grid.pitch_mm.z, grid.origin_mm.z, lattice.cell_mm.z);
  ListBuilder lists(lattice.points_mm.size());
  for (size_t pixel = 0; pixel < lattice.points_mm.size(); ++pixel) {
    const std::optional<Vec3>& point = lattice.points_mm[pixel];
    if (!point.has_value()) continue;
    const LightCells x = axis_x.CellsOf(point->x);
    const LightCells y = axis_y.CellsOf(point->y);
    const LightCells z = axis_z.CellsOf(point->z);
    for (int32_t k = z.box.begin; k < z.box.end; ++k) {
      for (int32_t j = y.box.begin; j < y.box.end; ++j) {
        for (int32_t i = x.box.begin; i < x.box.end; ++i) lists.Add(pixel, EntryAt(i, j, k));
      }
    }
    if (x.own >= 0 && y.own >= 0 && z.own >= 0) lists.Add(pixel, EntryAt(x.own, y.own, z.own));
  }

  FootprintTable table;
  table.slices = LatticeSlices(lattice);
  table.width = lattice.width_px;
  table.height = 1;
  table.inner_axis = Axis::kZ;
  table.outer = lists.Build();
  table.inner = {{0, 1}, {EntryAt(0, 0, 0)}};
  return table;
}

Vec3 LatticePixelPosition(const Lattice& lattice, int32_t slice, int32_t u) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const size_t pixel =
      static_cast<size_t>(slice) * static_cast<size_t>(lattice.width_px) + static_cast<size_t>(u);
  return lattice.points_mm[pixel].value_or(Vec3{kNone, kNone, kNone});
}

}  // namespace voxeld::display
