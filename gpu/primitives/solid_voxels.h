// The voxels of a solid, filled or as its surface: the inside voxels with a neighbour outside,
// among the 6 that share a face (THIN: 6-separating) or among all 26 (COVER). Host and device.
//
// Guarantee: the surface lies within the solid. No path of steps across faces passes through a THIN
// surface, and no path at all through a COVER one.
#pragma once

#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

// Rows of 32 voxels as bits, bit i for x0 + i: for a block of up to 16 × 16 rows with a margin of
// one voxel on all sides. Larger boxes are drawn block by block.
struct SolidBlock {
  static constexpr int32_t kInner = kTileSize;
  static constexpr int32_t kRows = kInner + 2;
  uint32_t bits[kRows][kRows] = {};  // [z][y]

  // Sets the bits of the voxels that are inside, from `lo` up to, but without, `hi`. Returns
  // whether there are any. Requires: at most kRows along each axis.
  template <class Shape>
  VOXELD_HD bool Fill(const Solid& s, const int64_t lo[3], const int64_t hi[3]) {
    uint32_t any = 0;
    for (int64_t z = lo[2]; z < hi[2]; ++z) {
      for (int64_t y = lo[1]; y < hi[1]; ++y) any |= FillRow<Shape>(s, lo, hi, y, z);
    }
    return any != 0;
  }

  // Fills one row of the block; rows may be filled in parallel.
  template <class Shape>
  VOXELD_HD uint32_t FillRow(const Solid& s, const int64_t lo[3], const int64_t hi[3], int64_t y,
                             int64_t z) {
    uint32_t row = 0;
    if (z >= s.bounds.lo[2] && z < s.bounds.hi[2] && y >= s.bounds.lo[1] && y < s.bounds.hi[1]) {
      const float dy = s.Distance(1, y), dz = s.Distance(2, z);
      const int64_t x1 = Min<int64_t>(hi[0], s.bounds.hi[0]);
      for (int64_t x = Max<int64_t>(lo[0], s.bounds.lo[0]); x < x1; ++x) {
        float q[3];
        s.Canonical(s.Distance(0, x), dy, dz, q);
        row |= static_cast<uint32_t>(Shape::Contains(q)) << (x - lo[0]);
      }
    }
    bits[z - lo[2]][y - lo[1]] = row;
    return row;
  }

  // Returns the voxels of row (y, z) whose neighbours are all inside.
  VOXELD_HD uint32_t Enclosed(int32_t y, int32_t z, SurfaceRule rule) const {
    if (rule == SurfaceRule::kThin) {
      const uint32_t row = bits[z][y];
      return (row << 1) & (row >> 1) & bits[z][y - 1] & bits[z][y + 1] & bits[z - 1][y] &
             bits[z + 1][y];
    }
    uint32_t all = ~0u;
    for (int32_t dz = -1; dz <= 1; ++dz) {
      for (int32_t dy = -1; dy <= 1; ++dy) {
        const uint32_t row = bits[z + dz][y + dy];
        all &= row & (row << 1) & (row >> 1);
      }
    }
    return all;
  }
};

template <class Shape, class Emit>
VOXELD_HD void EmitSolidBlock(const Solid& s, const GeometryRecord& g, uint32_t rgb,
                              const Box3& block, Emit&& emit) {
  SolidBlock b;
  int64_t lo[3], hi[3];
  for (int a = 0; a < 3; ++a) {
    lo[a] = static_cast<int64_t>(block.lo[a]) - 1;
    hi[a] = static_cast<int64_t>(block.hi[a]) + 1;
  }
  if (!b.Fill<Shape>(s, lo, hi)) return;
  for (int32_t z = block.lo[2]; z < block.hi[2]; ++z) {
    for (int32_t y = block.lo[1]; y < block.hi[1]; ++y) {
      const int32_t rz = z - block.lo[2] + 1, ry = y - block.lo[1] + 1;
      uint32_t row = b.bits[rz][ry];
      if (row != 0 && g.fill == Fill::kSurface) row &= ~b.Enclosed(ry, rz, g.rule);
      for (int32_t x = block.lo[0]; x < block.hi[0]; ++x) {
        if ((row >> (x - block.lo[0] + 1)) & 1u) emit(x, y, z, rgb);
      }
    }
  }
}

// The common part of the three solids. `Shape` has CanonicalMap and Contains.
template <class Shape>
struct SolidPrimitive {
  VOXELD_HD static uint32_t Count(const Source& source) { return source.solid.drawable ? 1 : 0; }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t, const TileGrid& grid,
                                  Emit&& emit) {
    EmitTilesOfBox(source.solid.bounds, grid, emit);
  }

  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t, const Box3& box, Emit&& emit) {
    const Solid& s = source.solid;
    const uint32_t rgb = source.UniformColor();
    if (Contains(box, s.origin[0], s.origin[1], s.origin[2]) &&
        !IsInside<Shape>(s, s.origin[0], s.origin[1], s.origin[2])) {
      emit(static_cast<int32_t>(s.origin[0]), static_cast<int32_t>(s.origin[1]),
           static_cast<int32_t>(s.origin[2]), rgb);
    }
    const Box3 part = Intersect(box, s.bounds);
    constexpr int32_t kStep = SolidBlock::kInner;
    for (int32_t z = part.lo[2]; z < part.hi[2]; z += kStep) {
      for (int32_t y = part.lo[1]; y < part.hi[1]; y += kStep) {
        for (int32_t x = part.lo[0]; x < part.hi[0]; x += kStep) {
          const Box3 block{
              {x, y, z},
              {Min(x + kStep, part.hi[0]), Min(y + kStep, part.hi[1]), Min(z + kStep, part.hi[2])}};
          EmitSolidBlock<Shape>(s, *source.record, rgb, block, emit);
        }
      }
    }
  }
};

// Returns the map from canonical coordinates to the geometry's, given by centre and half sizes.
VOXELD_HD inline Affine CentreAndHalves(const float* centre, double hx, double hy, double hz) {
  Affine a;
  a.m[0] = hx;
  a.m[5] = hy;
  a.m[10] = hz;
  for (int i = 0; i < 3; ++i) a.m[i * 4 + 3] = static_cast<double>(centre[i]);
  return a;
}

}  // namespace voxeld::gpu
