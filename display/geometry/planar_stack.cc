#include "display/geometry/planar_stack.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "display/geometry/slabs.h"

namespace voxeld::display {
namespace {

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
  StackDepth depth = {std::numeric_limits<double>::max(), std::numeric_limits<double>::lowest()};
  for (int32_t stroke = 0; stroke < stack.strokes; ++stroke) {
    std::vector<double> p;
    for (const int32_t slice : SlicesOfStroke(stack, stroke)) {
      p.push_back(stack.positions_mm[static_cast<size_t>(slice)]);
    }
    const size_t n = p.size();
    const double below = n == 1 ? stack.thickness_mm : p[1] - p[0];
    const double above = n == 1 ? stack.thickness_mm : p[n - 1] - p[n - 2];
    depth.low_mm = std::min(depth.low_mm, p[0] - 0.5 * below);
    depth.high_mm = std::max(depth.high_mm, p[n - 1] + 0.5 * above);
  }
  return depth;
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
  std::vector<std::vector<WeightedCell>> depths(stack.positions_mm.size());  // per slice
  for (int32_t stroke = 0; stroke < stack.strokes; ++stroke) {
    const Slabs slabs(stack, stroke, along);
    const std::vector<int32_t> slices = SlicesOfStroke(stack, stroke);
    for (size_t rank = 0; rank < slices.size(); ++rank) {
      depths[static_cast<size_t>(slices[rank])] = slabs.Cells(rank, sampling);
    }
  }
  table.outer.begin.push_back(0);
  for (const std::vector<WeightedCell>& of_slice : depths) {
    for (const CellRange& range : columns) {
      for (const WeightedCell& depth : of_slice) {
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
