#include "daemon/pipeline/slice_numbers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <variant>

#include "display/geometry/corrector.h"
#include "display/geometry/footprint.h"

namespace voxeld::daemon {
namespace {

using display::Geometry;

constexpr int32_t kMostNumbers = 64;
constexpr uint32_t kColors[8] = {0xFF0000, 0x00FF00, 0x4060FF, 0xFFFF00,
                                 0xFF00FF, 0x00FFFF, 0xFF8000, 0xFFFFFF};

// Three columns by five rows, the top one first, the left column in the highest bit.
constexpr int32_t kColumns = 3, kRows = 5, kAdvance = kColumns + 1;
constexpr std::array<std::array<uint8_t, kRows>, 10> kDigits = {{{7, 5, 5, 5, 7},
                                                                 {2, 6, 2, 2, 7},
                                                                 {7, 1, 7, 4, 7},
                                                                 {7, 1, 3, 1, 7},
                                                                 {5, 5, 7, 1, 1},
                                                                 {7, 4, 7, 1, 7},
                                                                 {7, 4, 7, 5, 7},
                                                                 {7, 1, 1, 2, 2},
                                                                 {7, 5, 7, 5, 7},
                                                                 {7, 5, 7, 1, 7}}};

display::Vec3 ToVoxels(const display::VoxelGrid& grid, const display::Vec3& mm) {
  return {(mm.x - grid.origin_mm.x) / grid.pitch_mm.x, (mm.y - grid.origin_mm.y) / grid.pitch_mm.y,
          (mm.z - grid.origin_mm.z) / grid.pitch_mm.z};
}

std::pair<bool, bool> MirroredIn(const Geometry& geometry, int32_t slice) {
  if (const auto* rotor = std::get_if<display::Rotor>(&geometry.shape)) {
    const auto& panel = rotor->panels[static_cast<size_t>(slice) % rotor->panels.size()];
    return {panel.mirror_u, panel.mirror_v};
  }
  if (const auto* stack = std::get_if<display::PlanarStack>(&geometry.shape)) {
    return {stack->mirror_u, stack->mirror_v};
  }
  const auto& helix = std::get<display::Helix>(geometry.shape);
  return {helix.mirror_u, helix.mirror_v};
}

// Of a turning display the slices from one number to the next, so that at their inner end, which begins at column `left`, they
// stand four pixels apart; all of one panel.
int32_t Apart(const Geometry& geometry, int32_t slices, int32_t left) {
  constexpr double kPixelsApart = 4;
  const auto* rotor = std::get_if<display::Rotor>(&geometry.shape);
  const auto panels = rotor == nullptr ? 1 : static_cast<int32_t>(rotor->panels.size());
  const int32_t width =
      std::visit([](const auto& shape) { return shape.width_px; }, geometry.shape);
  const double radius = std::max(1.0, std::max(0, left) - width / 2.0);
  const auto every =
      static_cast<int32_t>(std::ceil(kPixelsApart * slices / (2 * std::numbers::pi * radius)));
  return std::min(slices, (every + panels - 1) / panels * panels);
}

std::vector<NumberedVoxel> OfLights(const Geometry& geometry, const display::Lattice& lattice) {
  const display::Corrector corrector(geometry.correction);
  std::vector<NumberedVoxel> out;
  for (size_t pixel = 0; pixel < lattice.points_mm.size(); ++pixel) {
    if (!lattice.points_mm[pixel].has_value()) continue;
    const size_t slice = pixel / static_cast<size_t>(lattice.width_px);
    const bool first = pixel % static_cast<size_t>(lattice.width_px) == 0;
    out.push_back({ToVoxels(geometry.grid, corrector.ToTrue(*lattice.points_mm[pixel])),
                   first ? 0xFFFFFF : kColors[slice % 7]});
  }
  return out;
}

}  // namespace

std::vector<NumberedVoxel> SliceNumbers(const Geometry& geometry) {
  if (const auto* lattice = std::get_if<display::Lattice>(&geometry.shape)) {
    return OfLights(geometry, *lattice);
  }
  const auto [width, height] = std::visit(
      [](const auto& shape) { return std::pair(shape.width_px, shape.height_px); }, geometry.shape);
  const int32_t slices = display::SliceCount(geometry);
  const bool turns = !std::holds_alternative<display::PlanarStack>(geometry.shape);
  const auto digits = static_cast<int32_t>(std::to_string(slices - 1).size());
  const int32_t scale = std::max(1, std::min(height / 40, width / (16 * digits)));
  const int32_t wide = (digits * kAdvance - 1) * scale;
  // Side by side, so that they do not hide each other: in a turning display they stand on a ring anyway.
  const int32_t places = turns ? 1 : std::max(1, width / (wide + 2 * scale));
  const int32_t every = std::max((slices + kMostNumbers - 1) / kMostNumbers,
                                 turns ? Apart(geometry, slices, width - wide - width / 16) : 1);
  const display::Corrector corrector(geometry.correction);
  std::vector<NumberedVoxel> out;
  for (int32_t slice = 0; slice < slices; slice += every) {
    const std::string text = std::to_string(slice);
    const int32_t number = slice / every;
    const int32_t left =
        turns ? std::max(0, width - wide - width / 16) : number % places * (wide + 2 * scale);
    const int32_t bottom = (height - kRows * scale) / 2;
    const auto [mirror_u, mirror_v] = MirroredIn(geometry, slice);
    for (size_t digit = 0; digit < text.size(); ++digit) {
      const auto& rows = kDigits[static_cast<size_t>(text[digit] - '0')];
      for (int32_t i = 0; i < kColumns * kRows * scale * scale; ++i) {
        const int32_t x = i % (kColumns * scale), y = i / (kColumns * scale);
        const uint32_t row = rows[static_cast<size_t>(kRows - 1 - y / scale)];
        if ((row >> (kColumns - 1 - x / scale) & 1) == 0) continue;
        int32_t u = left + static_cast<int32_t>(digit) * kAdvance * scale + x, v = bottom + y;
        if (mirror_u) u = width - 1 - u;
        if (mirror_v) v = height - 1 - v;
        if (u < 0 || u >= width || v < 0 || v >= height) continue;
        const display::Vec3 at = display::PixelPosition(geometry, corrector, slice, u, v);
        if (std::isnan(at.x)) continue;  // no blade is there
        out.push_back({ToVoxels(geometry.grid, at), kColors[number % 8]});
      }
    }
  }
  return out;
}

}  // namespace voxeld::daemon
