#include "daemon/viewer/near_pixels.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "display/geometry/rotor.h"

namespace voxeld::daemon::viewer {
namespace {

using display::Vec3;

// Returns: at most half the distance from a pixel to the next, in mm along each axis.
Vec3 HalfOf(const display::PlanarStack& stack) {
  double gap = stack.thickness_mm;
  const size_t each = stack.positions_mm.size() / static_cast<size_t>(stack.strokes);
  if (each > 1) gap = 0;
  for (size_t i = 1; i < stack.positions_mm.size(); ++i) {
    if (i % each == 0) continue;  // another stroke begins
    gap = std::max(gap, std::abs(stack.positions_mm[i] - stack.positions_mm[i - 1]));
  }
  const bool flat = stack.normal == display::PlanarStack::Normal::kZ;
  return {stack.pitch_u_mm / 2, (flat ? stack.pitch_v_mm : gap) / 2,
          (flat ? gap : stack.pitch_v_mm) / 2};
}

Vec3 HalfOf(const display::Rotor& rotor) {
  double across = 2 * std::numbers::pi * display::RadiusMm(rotor) / rotor.slices_per_turn, up = 0;
  for (const display::Rotor::Panel& panel : rotor.panels) {
    across = std::max(across, panel.pitch_u_mm);
    up = std::max(up, panel.pitch_v_mm);
  }
  return {across / 2, across / 2, up / 2};
}

Vec3 HalfOf(const display::Helix& helix) {
  // The blade rises by this much at a pixel during one slice.
  const double rise = helix.height_mm / (helix.span_turns * helix.slices_per_turn);
  return {helix.pitch_u_mm / 2, helix.pitch_v_mm / 2, rise / 2};
}

Vec3 HalfOf(const display::Lattice& lattice) {
  return {lattice.cell_mm.x / 2, lattice.cell_mm.y / 2, lattice.cell_mm.z / 2};
}

}  // namespace

Reach ReachOf(const display::Geometry& geometry, display::Sampling sampling) {
  const Vec3 half = std::visit([](const auto& shape) { return HalfOf(shape); }, geometry.shape);
  // The pixel may be anywhere in its cell.
  const double share = sampling == display::Sampling::kWeighted ? 2 : 1;
  const auto cells = [&](double mm, double pitch, int32_t n) {
    constexpr double kSlack = 1e-6;
    return static_cast<int32_t>(std::clamp(std::ceil(share * mm / pitch + 0.5 - kSlack), 1.0,
                                           static_cast<double>(std::max(1, n))));
  };
  const display::VoxelGrid& grid = geometry.grid;
  return {cells(half.x, grid.pitch_mm.x, grid.nx), cells(half.y, grid.pitch_mm.y, grid.ny),
          cells(half.z, grid.pitch_mm.z, grid.nz)};
}

NearPixels::NearPixels(const display::VoxelGrid& grid, const Reach& reach)
    : nx_(static_cast<size_t>(grid.nx)),
      ny_(static_cast<size_t>(grid.ny)),
      reach_x_(static_cast<size_t>(reach.x)),
      reach_y_(static_cast<size_t>(reach.y)),
      counts_(nx_ * ny_) {}

std::vector<uint8_t> NearPixels::Reached(std::span<const PixelCell> pixels) const {
  if (pixels.empty()) return {};
  // The plane has a border as wide as the reach.
  const size_t wide = nx_ + 2 * reach_x_, high = ny_ + 2 * reach_y_;
  std::vector<uint8_t> lit(wide * high);
  for (const PixelCell& pixel : pixels) {
    lit[(static_cast<size_t>(pixel.y + static_cast<int32_t>(reach_y_))) * wide +
        static_cast<size_t>(pixel.x + static_cast<int32_t>(reach_x_))] = 1;
  }
  // Counts lit cells in a sliding window, along x and then along y.
  std::vector<uint8_t> rows(nx_ * high);
  for (size_t y = 0; y < high; ++y) {
    const uint8_t* from = &lit[y * wide];
    size_t in = 0;
    for (size_t x = 0; x < 2 * reach_x_; ++x) in += from[x];
    for (size_t x = 0; x < nx_; ++x) {
      in += from[x + 2 * reach_x_];
      rows[y * nx_ + x] = in > 0 ? 1 : 0;
      in -= from[x];
    }
  }
  std::vector<uint8_t> reached(nx_ * ny_);
  std::vector<uint32_t> in(nx_);
  for (size_t y = 0; y < high; ++y) {
    for (size_t x = 0; x < nx_; ++x) in[x] += rows[y * nx_ + x];
    if (y < 2 * reach_y_) continue;
    const size_t at = y - 2 * reach_y_;
    for (size_t x = 0; x < nx_; ++x) {
      reached[at * nx_ + x] = in[x] > 0 ? 1 : 0;
      in[x] -= rows[at * nx_ + x];
    }
  }
  return reached;
}

void NearPixels::Add(std::span<const PixelCell> pixels) {
  planes_.push_back(Reached(pixels));
  const std::vector<uint8_t>& plane = planes_.back();
  for (size_t i = 0; i < plane.size(); ++i) counts_[i] += plane[i];
}

void NearPixels::Drop() {
  const std::vector<uint8_t>& plane = planes_.front();
  for (size_t i = 0; i < plane.size(); ++i) counts_[i] -= plane[i];
  planes_.pop_front();
}

}  // namespace voxeld::daemon::viewer
