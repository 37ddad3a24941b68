#include "display/geometry/slabs.h"

#include <algorithm>

#include "display/geometry/planar_stack.h"
#include "display/geometry/weight_between.h"

namespace voxeld::display {

std::vector<int32_t> SlicesOfStroke(const PlanarStack& stack, int32_t stroke) {
  const std::vector<double>& p = stack.positions_mm;
  const size_t count = p.size() / static_cast<size_t>(stack.strokes);
  const size_t begin = static_cast<size_t>(stroke) * count;
  std::vector<int32_t> slices;
  for (size_t s = begin; s < begin + count; ++s) slices.push_back(static_cast<int32_t>(s));
  if (count > 1 && p[begin] > p[begin + 1]) std::reverse(slices.begin(), slices.end());
  return slices;
}

Slabs::Slabs(const PlanarStack& stack, int32_t stroke, const GridAxis& axis) : axis_(axis) {
  for (const int32_t slice : SlicesOfStroke(stack, stroke)) {
    const double position = stack.positions_mm[static_cast<size_t>(slice)];
    positions_.push_back(ToFixed(position - axis.origin_mm, axis.pitch_mm));
  }
  const size_t n = positions_.size();
  if (n == 1) {
    const double at = stack.positions_mm[static_cast<size_t>(stroke)];
    twice_low_ = 2 * ToFixed(at - 0.5 * stack.thickness_mm - axis.origin_mm, axis.pitch_mm);
    twice_high_ = 2 * ToFixed(at + 0.5 * stack.thickness_mm - axis.origin_mm, axis.pitch_mm);
  } else {
    twice_low_ = 3 * positions_[0] - positions_[1];
    twice_high_ = 3 * positions_[n - 1] - positions_[n - 2];
  }
}

std::vector<WeightedCell> Slabs::Cells(size_t rank, Sampling sampling) const {
  return sampling == Sampling::kWeighted ? Weighted(rank) : Unweighted(rank);
}

// Slabs are half-open: a place half-way between two slices belongs to the upper one.
size_t Slabs::RankAt(Fixed place) const {
  const auto above = std::upper_bound(positions_.begin(), positions_.end(), place);
  const auto rank = static_cast<size_t>(above - positions_.begin());
  if (rank == 0) return 0;
  if (rank == positions_.size()) return rank - 1;
  return 2 * place < positions_[rank - 1] + positions_[rank] ? rank - 1 : rank;
}

std::vector<WeightedCell> Slabs::Unweighted(size_t rank) const {
  const Fixed at = positions_[rank];
  const Fixed twice_low = first(rank) ? twice_low_ : positions_[rank - 1] + at;
  const Fixed twice_high = last(rank) ? twice_high_ : at + positions_[rank + 1];
  std::vector<WeightedCell> cells;
  const CellRange range = CellsBetween(twice_low, twice_high, at, axis_.cells);
  for (int32_t cell = range.begin; cell < range.end; ++cell) cells.push_back({cell, kFullWeight});
  return cells;
}

std::vector<WeightedCell> Slabs::Weighted(size_t rank) const {
  const Fixed at = positions_[rank];
  const Fixed twice_low = first(rank) ? twice_low_ : 2 * positions_[rank - 1];
  const Fixed twice_high = last(rank) ? twice_high_ : 2 * positions_[rank + 1];
  std::vector<WeightedCell> cells;
  const CellRange range = CellsBetween(twice_low, twice_high, at, axis_.cells);
  for (int32_t cell = range.begin; cell < range.end; ++cell) {
    const uint16_t least = cell == at >> kFixedBits ? kOwnWeight : 0;
    const uint16_t weight = std::max(least, WeightOf(rank, cell * kFixedOne + kFixedHalf));
    if (weight > 0) cells.push_back({cell, weight});
  }
  return cells;
}

uint16_t Slabs::WeightOf(size_t rank, Fixed place) const {
  const Fixed distance = place - positions_[rank];
  if (distance < 0 ? first(rank) : last(rank)) {
    const bool in_slab = 2 * place >= twice_low_ && 2 * place < twice_high_;
    return in_slab ? kFullWeight : 0;
  }
  if (distance == 0) return kFullWeight;
  const Fixed spacing = distance < 0 ? positions_[rank] - positions_[rank - 1]
                                     : positions_[rank + 1] - positions_[rank];
  const Fixed left = spacing - (distance < 0 ? -distance : distance);
  if (left <= 0) return 0;
  return WeightBetween(static_cast<uint64_t>(distance < 0 ? -distance : distance),
                       static_cast<uint64_t>(left));
}

}  // namespace voxeld::display
