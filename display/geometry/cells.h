// Which cells of one axis of the grid a row of pixels, or a slice, stands for.
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

// The cells of [0, cells) whose centre lies in [twice_low / 2, twice_high / 2). Halves, so that the
// middle between two positions is exact.
CellRange CellsBetween(Fixed twice_low, Fixed twice_high, int32_t cells);

// These, and the one that holds `inside`, a position between the two. They are neighbours: a stretch of which a point lies beyond half a cell from a centre of
// its own is longer than a cell.
CellRange CellsBetween(Fixed twice_low, Fixed twice_high, Fixed inside, int32_t cells);

// The pixels of one picture axis: `count` of them, `pitch_mm` apart, their middle at `middle_mm`.
struct PixelRow {
  int32_t count = 0;
  double pitch_mm = 1;
  double middle_mm = 0;
  bool mirror = false;  // pixel 0 is at the far end
  bool operator==(const PixelRow&) const = default;

  // Place from the near end of pixel `index`, and back.
  int32_t Place(int32_t index) const { return mirror ? count - 1 - index : index; }
  // `twice_place`: 0 the near end, 1 the middle of the pixel at place 0, 2·count the far end.
  double PositionMm(int32_t twice_place) const {
    return (0.5 * twice_place - 0.5 * count) * pitch_mm + middle_mm;
  }
  double CentreMm(int32_t index) const { return PositionMm(2 * Place(index) + 1); }
};

// Of each pixel of `row`, the cells of an axis of `cells` cells
// of `pitch_mm` that begins at `origin_mm`.
std::vector<CellRange> CellsOfPixels(const PixelRow& row, int32_t cells, double pitch_mm,
                                     double origin_mm);

}  // namespace voxeld::display
