// The slabs that the slices of a planar stack represent along its normal, in fixed point.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/cells.h"
#include "display/geometry/fixed_point.h"

namespace voxeld::display {

struct WeightedCell {
  int32_t cell;
  uint16_t weight;
};

struct GridAxis {
  int32_t cells;
  double pitch_mm, origin_mm;
};

// Returns the slices of one stroke, by ascending position.
std::vector<int32_t> SlicesOfStroke(const PlanarStack& stack, int32_t stroke);

// The slabs of one stroke; here slices are counted by ascending position ("ranks").
class Slabs {
 public:
  Slabs(const PlanarStack& stack, int32_t stroke, const GridAxis& axis);

  size_t count() const { return positions_.size(); }
  std::vector<WeightedCell> Cells(size_t rank, Sampling sampling) const;

  // Calls each(rank, weight) for the slices that represent a place on the normal, in the axis's
  // units.
  template <typename Each>
  void ForEachAt(Fixed place, Sampling sampling, Each&& each) const {
    if (2 * place < twice_low_ || 2 * place >= twice_high_) return;
    const size_t own = RankAt(place);
    each(own, kWhole);
    if (sampling != Sampling::kWeighted) return;
    for (const size_t beside : {own - 1, own + 1}) {
      if (beside >= positions_.size()) continue;
      if (const uint16_t weight = WeightOf(beside, place); weight > 0) each(beside, weight);
    }
  }

 private:
  static constexpr uint16_t kWhole = 255;

  bool first(size_t rank) const { return rank == 0; }
  bool last(size_t rank) const { return rank + 1 == positions_.size(); }
  size_t RankAt(Fixed place) const;
  std::vector<WeightedCell> Unweighted(size_t rank) const;
  std::vector<WeightedCell> Weighted(size_t rank) const;
  // Returns 0 for a place beyond the neighbouring slices.
  uint16_t WeightOf(size_t rank, Fixed place) const;

  const GridAxis axis_;
  std::vector<Fixed> positions_;
  Fixed twice_low_ = 0, twice_high_ = 0;  // the bounds of all slabs
};

}  // namespace voxeld::display
