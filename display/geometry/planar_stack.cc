#include "display/geometry/planar_stack.h"

#include <algorithm>
#include <vector>

#include "display/geometry/fixed_point.h"
#include "display/geometry/weight_between.h"

namespace voxeld::display {
namespace {

struct WeightedCell {
  int32_t cell;
  uint16_t weight;
};

struct GridAxis {
  int32_t cells;
  double pitch_mm, origin_mm;
};

// Slabs along the normal, in fixed point.
class Slabs {
 public:
  Slabs(const PlanarStack& stack, const GridAxis& axis) : axis_(axis) {
    for (const double position : stack.positions_mm) {
      positions_.push_back(ToFixed(position - axis.origin_mm, axis.pitch_mm));
    }
    const size_t n = positions_.size();
    if (n == 1) {
      const StackDepth depth = DepthOf(stack);
      twice_low_ = 2 * ToFixed(depth.low_mm - axis.origin_mm, axis.pitch_mm);
      twice_high_ = 2 * ToFixed(depth.high_mm - axis.origin_mm, axis.pitch_mm);
    } else {
      twice_low_ = 3 * positions_[0] - positions_[1];
      twice_high_ = 3 * positions_[n - 1] - positions_[n - 2];
    }
  }

  std::vector<WeightedCell> Cells(size_t slice, Sampling sampling) const {
    return sampling == Sampling::kWeighted ? Weighted(slice) : Unweighted(slice);
  }

 private:
  bool first(size_t slice) const { return slice == 0; }
  bool last(size_t slice) const { return slice + 1 == positions_.size(); }

  std::vector<WeightedCell> Unweighted(size_t slice) const {
    const Fixed at = positions_[slice];
    const Fixed twice_low = first(slice) ? twice_low_ : positions_[slice - 1] + at;
    const Fixed twice_high = last(slice) ? twice_high_ : at + positions_[slice + 1];
    std::vector<WeightedCell> cells;
    const CellRange range = CellsBetween(twice_low, twice_high, at, axis_.cells);
    for (int32_t cell = range.begin; cell < range.end; ++cell) {
      cells.push_back({cell, kFullWeight});
    }
    return cells;
  }

  std::vector<WeightedCell> Weighted(size_t slice) const {
    const Fixed at = positions_[slice];
    const Fixed twice_low = first(slice) ? twice_low_ : 2 * positions_[slice - 1];
    const Fixed twice_high = last(slice) ? twice_high_ : 2 * positions_[slice + 1];
    std::vector<WeightedCell> cells;
    const CellRange range = CellsBetween(twice_low, twice_high, at, axis_.cells);
    for (int32_t cell = range.begin; cell < range.end; ++cell) {
      const uint16_t least = cell == at >> kFixedBits ? kOwnWeight : 0;
      const uint16_t weight = std::max(least, WeightOf(slice, cell));
      if (weight > 0) cells.push_back({cell, weight});
    }
    return cells;
  }

  // 0 for a cell whose centre lies beyond the neighbouring slices.
  uint16_t WeightOf(size_t slice, int32_t cell) const {
    const Fixed centre = cell * kFixedOne + kFixedHalf;
    const Fixed distance = centre - positions_[slice];
    if (distance < 0 ? first(slice) : last(slice)) {
      const bool in_slab = 2 * centre >= twice_low_ && 2 * centre < twice_high_;
      return in_slab ? kFullWeight : 0;
    }
    if (distance == 0) return kFullWeight;
    const Fixed spacing = distance < 0 ? positions_[slice] - positions_[slice - 1]
                                       : positions_[slice + 1] - positions_[slice];
    const Fixed left = spacing - (distance < 0 ? -distance : distance);
    if (left <= 0) return 0;
    return WeightBetween(static_cast<uint64_t>(distance < 0 ? -distance : distance),
                         static_cast<uint64_t>(left));
  }

  const GridAxis axis_;
  std::vector<Fixed> positions_;
  Fixed twice_low_ = 0, twice_high_ = 0;  // the ends of all slabs
};

void EndList(FootprintLists& lists) {
  lists.begin.push_back(static_cast<uint32_t>(lists.entries.size()));
}

}  // namespace

PixelRow StackRowU(const PlanarStack& stack) {
  return {stack.width_px, stack.pitch_u_mm, 0, stack.mirror_u};
}

PixelRow StackRowV(const PlanarStack& stack) {
  return {stack.height_px, stack.pitch_v_mm, 0, stack.mirror_v};
}

StackDepth DepthOf(const PlanarStack& stack) {
  const std::vector<double>& p = stack.positions_mm;
  const size_t n = p.size();
  if (n == 1) return {p[0] - 0.5 * stack.thickness_mm, p[0] + 0.5 * stack.thickness_mm};
  return {p[0] - 0.5 * (p[1] - p[0]), p[n - 1] + 0.5 * (p[n - 1] - p[n - 2])};
}

FootprintTable BuildStackFootprints(const PlanarStack& stack, const VoxelGrid& grid,
                                    Sampling sampling) {
  const GridAxis x{grid.nx, grid.pitch_mm.x, grid.origin_mm.x};
  const GridAxis y{grid.ny, grid.pitch_mm.y, grid.origin_mm.y};
  const GridAxis z{grid.nz, grid.pitch_mm.z, grid.origin_mm.z};
  const bool flat = stack.normal == PlanarStack::Normal::kZ;
  const GridAxis& across = flat ? y : z;
  const GridAxis& along = flat ? z : y;

  FootprintTable table;
  table.slices = static_cast<int32_t>(stack.positions_mm.size());
  table.width = stack.width_px;
  table.height = stack.height_px;
  table.inner_axis = flat ? Axis::kY : Axis::kZ;

  table.inner.begin.push_back(0);
  for (const CellRange& range :
       CellsOfPixels(StackRowV(stack), across.cells, across.pitch_mm, across.origin_mm)) {
    for (int32_t cell = range.begin; cell < range.end; ++cell) {
      const uint16_t c = static_cast<uint16_t>(cell);
      table.inner.entries.push_back(flat ? FootprintEntry{0, c, 0} : FootprintEntry{0, 0, c});
    }
    EndList(table.inner);
  }

  const std::vector<CellRange> columns =
      CellsOfPixels(StackRowU(stack), x.cells, x.pitch_mm, x.origin_mm);
  const Slabs slabs(stack, along);
  table.outer.begin.push_back(0);
  for (size_t slice = 0; slice < stack.positions_mm.size(); ++slice) {
    const std::vector<WeightedCell> depths = slabs.Cells(slice, sampling);
    for (const CellRange& range : columns) {
      for (const WeightedCell& depth : depths) {
        const uint16_t d = static_cast<uint16_t>(depth.cell);
        for (int32_t cell = range.begin; cell < range.end; ++cell) {
          const uint16_t c = static_cast<uint16_t>(cell);
          table.outer.entries.push_back(flat ? FootprintEntry{c, 0, d, depth.weight}
                                             : FootprintEntry{c, d, 0, depth.weight});
        }
      }
      EndList(table.outer);
    }
  }
  return table;
}

Vec3 StackPixelPosition(const PlanarStack& stack, int32_t slice, int32_t u, int32_t v) {
  const double at = stack.positions_mm[static_cast<size_t>(slice)];
  const double along_u = StackRowU(stack).CentreMm(u), along_v = StackRowV(stack).CentreMm(v);
  if (stack.normal == PlanarStack::Normal::kZ) return {along_u, along_v, at};
  return {along_u, at, along_v};
}

}  // namespace voxeld::display
