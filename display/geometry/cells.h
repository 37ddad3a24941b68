// Maps a row of pixels, or a slice, to the cells of one axis of the grid that it represents.
#pragma once

#include <cstdint>
#include <vector>

#include "display/geometry/fixed_point.h"

namespace voxeld::display {

// Cells [begin, end) of an axis; may be empty.
struct CellRange {
  int32_t begin = 0, end = 0;
  bool empty() const { return begin >= end; }
};

// Returns the cells of [0, cells) whose centre lies in [twice_low / 2, twice_high / 2). Arguments
// are doubled so that the middle between two positions is exact.
CellRange CellsBetween(Fixed twice_low, Fixed twice_high, int32_t cells);

// Returns these and the cell that contains `inside`, a position between the two. They are
// neighbours: if a point of a stretch lies beyond half a cell from a centre in it, the stretch is
// longer than a cell.
CellRange CellsBetween(Fixed twice_low, Fixed twice_high, Fixed inside, int32_t cells);

// The pixels of one axis of a slice image: `count` of them, `pitch_mm` apart, their middle at
// `middle_mm`.
struct PixelRow {
  int32_t count = 0;
  double pitch_mm = 1;
  double middle_mm = 0;
  bool mirror = false;  // pixel 0 is at the far end
  bool operator==(const PixelRow&) const = default;

  // Converts pixel `index` to its place from the near end, and back.
  int32_t Place(int32_t index) const { return mirror ? count - 1 - index : index; }
  // `twice_place` is 0 at the near end, 1 at the middle of the pixel at place 0, 2·count at the far
  // end.
  double PositionMm(int32_t twice_place) const {
    return (0.5 * twice_place - 0.5 * count) * pitch_mm + middle_mm;
  }
  double CentreMm(int32_t index) const { return PositionMm(2 * Place(index) + 1); }
};

// Returns, for each pixel of `row`, its cells on an axis of `cells` cells of `pitch_mm` that begins
// at `origin_mm`.
std::vector<CellRange> CellsOfPixels(const PixelRow& row, int32_t cells, double pitch_mm,
                                     double origin_mm);

}  // namespace voxeld::display
