// Finds the pixel of a row that contains a place along it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "display/geometry/cells.h"
#include "display/geometry/fixed_point.h"

namespace voxeld::display {

class PixelEdges {
 public:
  // Places are counted from `origin_mm`, in units of 2⁻¹⁶ `unit_mm`.
  PixelEdges(const PixelRow& row, double unit_mm, double origin_mm = 0) : row_(row) {
    edges_.reserve(static_cast<size_t>(row.count) + 1);
    for (int32_t place = 0; place <= row.count; ++place) {
      edges_.push_back(ToFixed(row.PositionMm(2 * place) - origin_mm, unit_mm));
    }
  }
  // Returns the pixel with edge ≤ at < next edge; nothing beyond the row's ends, or for no place.
  std::optional<int32_t> PixelAt(Fixed at) const {
    const auto above = std::upper_bound(edges_.begin(), edges_.end(), at);
    if (above == edges_.begin() || above == edges_.end()) return std::nullopt;
    return row_.Place(static_cast<int32_t>(above - edges_.begin()) - 1);
  }
  std::optional<int32_t> PixelAt(std::optional<Fixed> at) const {
    return at.has_value() ? PixelAt(*at) : std::nullopt;
  }

 private:
  PixelRow row_;
  std::vector<Fixed> edges_;
};

}  // namespace voxeld::display
