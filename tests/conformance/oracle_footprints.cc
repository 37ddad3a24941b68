#include "tests/conformance/oracle_footprints.h"

#include <cmath>
#include <optional>
#include <variant>

namespace voxeld::gpu::conformance {
namespace {

// Returns a length in units of 2⁻¹⁶ voxel, as display/geometry/footprint.h defines it: integers,
// represented exactly.
double ToUnits(double mm, double pitch_mm) { return std::floor(mm / pitch_mm * 65536 + 0.5); }

// The cells of an axis that are in a light's box, and the cell that contains the light; −1: none.
struct Cells {
  std::vector<int32_t> box;
  int32_t own = -1;
};

Cells CellsOf(double light_mm, double cell_mm, int32_t count, double pitch_mm, double origin_mm) {
  const double at = ToUnits(light_mm - origin_mm, pitch_mm), size = ToUnits(cell_mm, pitch_mm);
  Cells cells;
  for (int32_t cell = 0; cell < count; ++cell) {
    const double low = cell * 65536.0, centre = low + 32768;
    if (2 * (centre - at) >= -size && 2 * (centre - at) < size) cells.box.push_back(cell);
    if (at >= low && at < low + 65536) cells.own = cell;
  }
  return cells;
}

}  // namespace

OracleFootprints::OracleFootprints(const Target& target) : target_(target) {
  if (std::holds_alternative<display::Lattice>(target.geometry.shape)) return;
  table_ = display::BuildFootprints(target.geometry, target.tone.sampling);
}

std::vector<OracleVoxel> OracleFootprints::Of(int32_t slice, int32_t u, int32_t v) const {
  if (std::holds_alternative<display::Lattice>(target_.geometry.shape)) return OfLight(slice, u);
  std::vector<OracleVoxel> voxels;
  const bool flat = table_.flat_row > 0;
  for (const display::FootprintEntry& o : table_.Outer(slice, flat ? v * table_.flat_row + u : u)) {
    for (const display::FootprintEntry& i : table_.Inner(slice, flat ? 0 : v)) {
      voxels.push_back(
          {o.x + i.x, o.y + i.y, o.z + i.z, (uint32_t{o.weight} * i.weight + 127) / 255});
    }
  }
  return voxels;
}

std::vector<OracleVoxel> OracleFootprints::OfLight(int32_t slice, int32_t u) const {
  const auto& lattice = std::get<display::Lattice>(target_.geometry.shape);
  const display::VoxelGrid& grid = target_.geometry.grid;
  std::optional<display::Vec3> light =
      lattice.points_mm[static_cast<size_t>(slice * lattice.width_px + u)];
  if (light.has_value()) light = display::PixelPosition(target_.geometry, slice, u, 0);
  std::vector<OracleVoxel> voxels;
  if (!light.has_value()) return voxels;
  const Cells x = CellsOf(light->x, lattice.cell_mm.x, grid.nx, grid.pitch_mm.x, grid.origin_mm.x);
  const Cells y = CellsOf(light->y, lattice.cell_mm.y, grid.ny, grid.pitch_mm.y, grid.origin_mm.y);
  const Cells z = CellsOf(light->z, lattice.cell_mm.z, grid.nz, grid.pitch_mm.z, grid.origin_mm.z);
  for (const int32_t k : z.box) {
    for (const int32_t j : y.box) {
      for (const int32_t i : x.box) voxels.push_back({i, j, k, 255});
    }
  }
  if (x.own >= 0 && y.own >= 0 && z.own >= 0) voxels.push_back({x.own, y.own, z.own, 255});
  return voxels;
}

}  // namespace voxeld::gpu::conformance
