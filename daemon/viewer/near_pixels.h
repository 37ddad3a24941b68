// Which cells of a grid are near lit pixels, plane after plane.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"

namespace voxeld::daemon::viewer {

// How many cells along each axis "near" is.
struct Reach {
  int32_t x = 1, y = 1, z = 1;
  bool operator==(const Reach&) const = default;
};

// From a pixel's light half of the way to the next, where pixels are farthest apart, or all of it where what lies between
// is shown by both (depth anti-aliasing); one cell at least.
Reach ReachOf(const display::Geometry& geometry, display::Sampling sampling);

// A pixel's light by its cell, which may lie outside the grid.
struct PixelCell {
  int16_t x = 0, y = 0, z = 0;  // grids have 16384 cells along an axis at the most
  uint32_t point = 0;
};

// Planes are added in their order, those within reach before the grid's first included, and the oldest dropped; near is
// what is within reach of a pixel of the planes that are there. Not thread-safe.
class NearPixels {
 public:
  NearPixels(const display::VoxelGrid& grid, const Reach& reach);

  // Cells of pixels lie within reach of the grid.
  void Add(std::span<const PixelCell> pixels);
  void Drop();
  bool At(int32_t x, int32_t y) const {
    return counts_[static_cast<size_t>(y) * nx_ + static_cast<size_t>(x)] > 0;
  }

 private:
  std::vector<uint8_t> Reached(std::span<const PixelCell> pixels) const;

  const size_t nx_, ny_, reach_x_, reach_y_;
  std::deque<std::vector<uint8_t>>
      planes_;                    // 1: within reach of a pixel of the plane; empty: there is none
  std::vector<uint16_t> counts_;  // of the planes that are there
};

}  // namespace voxeld::daemon::viewer
