// Determines which cells of a grid are near lit pixels, plane by plane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::daemon::viewer {

// Distance in cells along each axis that counts as near.
struct Reach {
  int32_t x = 1, y = 1, z = 1;
  bool operator==(const Reach&) const = default;
};

// Returns: half of the greatest distance between neighbouring pixels, or all of it if both pixels
// show what lies between them (depth anti-aliasing); at least one cell.
Reach ReachOf(const display::Geometry& geometry, display::Sampling sampling);

// The cell of a pixel's light, which may be outside the grid.
struct PixelCell {
  int16_t x = 0, y = 0, z = 0;  // grids have at most 16384 cells along an axis
  uint32_t point = 0;
};

// A sliding window of planes. Add planes in order, beginning with those within reach before the
// grid's first; the oldest are dropped. A cell is near if it is within reach of a pixel in the
// window. Not thread-safe.
class NearPixels {
 public:
  NearPixels(const display::VoxelGrid& grid, const Reach& reach);

  // Requires: the cells of `pixels` are within reach of the grid.
  void Add(std::span<const PixelCell> pixels);
  void Drop();
  bool At(int32_t x, int32_t y) const {
    return counts_[static_cast<size_t>(y) * nx_ + static_cast<size_t>(x)] > 0;
  }

 private:
  std::vector<uint8_t> Reached(std::span<const PixelCell> pixels) const;

  const size_t nx_, ny_, reach_x_, reach_y_;
  // For each plane, 1 marks a cell within reach of one of its pixels; empty: none.
  std::deque<std::vector<uint8_t>> planes_;
  std::vector<uint16_t> counts_;  // of the planes in the window
};

}  // namespace voxeld::daemon::viewer
