#include "display/geometry/cells.h"

#include <algorithm>

namespace voxeld::display {
namespace {

// Returns the first cell whose centre is at twice_low / 2 or beyond, within [0, cells].
int32_t FirstCell(Fixed twice_low, int32_t cells) {
  constexpr Fixed kTwo = 2 * kFixedOne;
  const Fixed first = (twice_low - kFixedOne + (kTwo - 1)) >> (kFixedBits + 1);
  return static_cast<int32_t>(std::clamp<Fixed>(first, 0, cells));
}

}  // namespace

CellRange CellsBetween(Fixed twice_low, Fixed twice_high, int32_t cells) {
  return {FirstCell(twice_low, cells), FirstCell(twice_high, cells)};
}

CellRange CellsBetween(Fixed twice_low, Fixed twice_high, Fixed inside, int32_t cells) {
  const CellRange range = CellsBetween(twice_low, twice_high, cells);
  const Fixed own = inside >> kFixedBits;
  if (own < 0 || own >= cells) return range;
  const int32_t cell = static_cast<int32_t>(own);
  if (range.empty()) return {cell, cell + 1};
  return {std::min(range.begin, cell), std::max(range.end, cell + 1)};
}

std::vector<CellRange> CellsOfPixels(const PixelRow& row, int32_t cells, double pitch_mm,
                                     double origin_mm) {
  std::vector<CellRange> ranges(static_cast<size_t>(row.count));
  for (int32_t index = 0; index < row.count; ++index) {
    const int32_t place = row.Place(index);
    const auto at = [&](int32_t twice_place) {
      return ToFixed(row.PositionMm(twice_place) - origin_mm, pitch_mm);
    };
    ranges[static_cast<size_t>(index)] =
        CellsBetween(2 * at(2 * place), 2 * at(2 * place + 2), at(2 * place + 1), cells);
  }
  return ranges;
}

}  // namespace voxeld::display
