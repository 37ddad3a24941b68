// The inside of triangles, by parity: a voxel is covered if the ray from its centre towards −x
// meets an odd number of them. For a closed mesh that is its inside, whichever way its triangles
// face; where parts of it overlap, every second layer is covered. (Schwarz and Seidel, "Fast
// parallel surface and solid voxelization on GPUs", 2010, flip voxels in this way.)
//
// Exact, in whole numbers. A row of voxels, (y, z), meets a triangle if the line through its
// centres lies inside the triangle as seen along x. Lines through an edge or a corner are treated
// as if they were moved by a little along y and by much less along z, so of the triangles that
// share it, one is met, or none, or both. The row's parity changes at the first voxel whose centre
// is not before the triangle's plane. Rows that meet an odd number of triangles, which an open mesh
// can have, have no inside.
//
// Guarantee: the filled voxels are exact too, and the volume is right within 1 % at a radius of 20
// voxels.
#pragma once

#include "gpu/primitives/blocks.h"
#include "gpu/primitives/grid.h"
#include "gpu/primitives/source.h"

namespace voxeld::gpu {

// A bit for each voxel of a box, by row: x in words of 32 bits, from the multiple of 32 that holds
// the box's first voxel to the one that holds the voxel after its last; then y, then z.
struct InsideRows {
  Box3 box;

  VOXELD_HD int32_t first_word() const { return box.lo[0] >> 5; }
  VOXELD_HD int32_t words() const { return (box.hi[0] >> 5) + 1 - first_word(); }
  VOXELD_HD uint64_t rows() const {
    return static_cast<uint64_t>(box.hi[1] - box.lo[1]) *
           static_cast<uint64_t>(box.hi[2] - box.lo[2]);
  }
  VOXELD_HD uint64_t size() const {
    return IsEmpty(box) ? 0 : rows() * static_cast<uint64_t>(words());
  }
  // Returns the index of the word that holds a voxel of the box, or the voxel after its row.
  VOXELD_HD uint64_t PlaceOf(int32_t x, int32_t y, int32_t z) const {
    const uint64_t row =
        static_cast<uint64_t>(z - box.lo[2]) * static_cast<uint64_t>(box.hi[1] - box.lo[1]) +
        static_cast<uint64_t>(y - box.lo[1]);
    return row * static_cast<uint64_t>(words()) + static_cast<uint64_t>((x >> 5) - first_word());
  }
};

// Returns a word whose bit i is the parity of bits 0 to i.
VOXELD_HD constexpr uint32_t ParityUntil(uint32_t bits) {
  for (int shift = 1; shift < 32; shift <<= 1) bits ^= bits << shift;
  return bits;
}

// The crossings of rows with a triangle. I: an integer type that holds (the triangle's extent + 1
// voxel)³ units, four times.
template <class I>
struct RowCrossings {
  int64_t y[3], z[3];  // corners, ordered so that area > 0
  I area, by_y, by_z;  // its normal, in units²
  int64_t tie[3];      // edges: 0 if points on their line are inside, 1 if not
  int64_t x_voxel, x_rest;

  // Returns false if no row meets it.
  VOXELD_HD bool Set(const Int3 (&v)[3]) {
    area = I(v[1][1] - v[0][1]) * (v[2][2] - v[0][2]) - I(v[1][2] - v[0][2]) * (v[2][1] - v[0][1]);
    if (area == 0) return false;
    const int second = area > 0 ? 1 : 2, third = 3 - second;
    const Int3 &a = v[0], &b = v[second], &c = v[third];
    if (area < 0) area = -area;
    by_y = I(b[2] - a[2]) * (c[0] - a[0]) - I(b[0] - a[0]) * (c[2] - a[2]);
    by_z = I(b[0] - a[0]) * (c[1] - a[1]) - I(b[1] - a[1]) * (c[0] - a[0]);
    x_voxel = VoxelOf(a[0]);
    x_rest = a[0] - x_voxel * kUnitsPerVoxel;
    y[0] = a[1], y[1] = b[1], y[2] = c[1];
    z[0] = a[2], z[1] = b[2], z[2] = c[2];
    for (int i = 0; i < 3; ++i) {
      const int64_t dy = y[(i + 1) % 3] - y[i], dz = z[(i + 1) % 3] - z[i];
      tie[i] = dz < 0 || (dz == 0 && dy > 0) ? 0 : 1;
    }
    return true;
  }

  // Returns whether a row meets the triangle; then *x is the first voxel beyond it.
  VOXELD_HD bool Find(int32_t row_y, int32_t row_z, int64_t* x) const {
    const int64_t py = row_y * kUnitsPerVoxel + kHalfVoxel,
                  pz = row_z * kUnitsPerVoxel + kHalfVoxel;
    for (int i = 0; i < 3; ++i) {
      const int next = i == 2 ? 0 : i + 1;
      const I edge = I(y[next] - y[i]) * (pz - z[i]) - I(z[next] - z[i]) * (py - y[i]);
      if (edge < tie[i]) return false;
    }
    const I fall = by_y * (py - y[0]) + by_z * (pz - z[0]);
    *x = x_voxel + static_cast<int64_t>(
                       CeilDiv<I>(area * (x_rest - kHalfVoxel) - fall, area * kUnitsPerVoxel));
    return true;
  }
};

// Returns the rows of a box whose centre lines may meet a triangle.
VOXELD_HD inline Box3 RowsOf(const Int3 (&v)[3], const Box3& box) {
  Box3 rows = box;
  for (int a = 1; a < 3; ++a) {
    const int64_t least = Min(v[0][a], Min(v[1][a], v[2][a])),
                  most = Max(v[0][a], Max(v[1][a], v[2][a]));
    rows.lo[a] = Max(rows.lo[a], ToVoxel32(VoxelOf(least + kHalfVoxel - 1)));
    rows.hi[a] = Max(rows.lo[a], Min(rows.hi[a], ToVoxel32(VoxelOf(most - kHalfVoxel) + 1)));
  }
  return rows;
}

// Calls f(y, z, x) for the rows with numbers first, first + step, … of those rows of the box that
// meet the triangle; x is the first voxel beyond the triangle, clamped to box.lo[0] and box.hi[0].
template <class F>
VOXELD_HD void EmitCrossings(const Int3 (&v)[3], const Box3& box, uint32_t first, uint32_t step,
                             F&& f) {
  const Box3 rows = RowsOf(v, box);
  if (IsEmpty(rows)) return;
  const uint32_t ny = static_cast<uint32_t>(rows.hi[1] - rows.lo[1]),
                 nz = static_cast<uint32_t>(rows.hi[2] - rows.lo[2]);
  const auto emit_by = [&](auto crossings) {
    if (!crossings.Set(v)) return;
    for (uint64_t i = first; i < static_cast<uint64_t>(ny) * nz; i += step) {
      const int32_t y = rows.lo[1] + static_cast<int32_t>(i % ny),
                    z = rows.lo[2] + static_cast<int32_t>(i / ny);
      int64_t x;
      if (!crossings.Find(y, z, &x)) continue;
      f(y, z, static_cast<int32_t>(Clamp<int64_t>(x, box.lo[0], box.hi[0])));
    }
  };
  int64_t extent = 0;
  for (int a = 0; a < 3; ++a) {
    extent = Max(extent, Max(v[0][a], Max(v[1][a], v[2][a])) - Min(v[0][a], Min(v[1][a], v[2][a])));
  }
  constexpr int64_t kNarrow = int64_t{1} << 19;
  extent < kNarrow ? emit_by(RowCrossings<int64_t>()) : emit_by(RowCrossings<Wide>());
}

struct Filled {
  static constexpr PrimitiveKind kKind = PrimitiveKind::kFilled;

  // Sets the place of the shape, in blocks of `tiles` tiles along an edge, from `bounds` in the
  // volume, which need not be tight.
  static void Place(const Box3& bounds, int32_t tiles, Solid& solid, ImplicitPlace& place) {
    SetBlocks(bounds, tiles, solid, place);
    solid.drawable = true;
  }

  VOXELD_HD static uint32_t Count(const Source& source) { return CountBlocks(source); }

  VOXELD_HD static uint32_t CountTriangles(const Source& source) { return source.corners() / 3; }

  VOXELD_HD static void TriangleOf(const Source& source, uint32_t i, Int3 (&v)[3]) {
    for (uint32_t corner = 0; corner < 3; ++corner) {
      v[corner] = source.Vertex(source.VertexOf(i * 3 + corner));
    }
  }

  // Returns a bit for each of the 32 voxels, from a multiple of 32 on, that contain (x, y, z): 1 if
  // it is inside. Requires: (x, y, z) lies in the bounds. Without `source.inside` it tests every
  // triangle.
  VOXELD_HD static uint32_t InsideAround(const Source& source, int32_t x, int32_t y, int32_t z) {
    const InsideRows rows{source.solid.bounds};
    if (source.inside != nullptr) return source.inside[rows.PlaceOf(x, y, z)];
    const int32_t begin = x & ~31;
    const Box3 row{{begin, y, z}, {begin + 32, y + 1, z + 1}};
    uint32_t flips = 0;
    bool open = false;
    for (uint32_t i = 0; i < CountTriangles(source); ++i) {
      Int3 v[3];
      TriangleOf(source, i, v);
      if (IsEmpty(RowsOf(v, row))) continue;
      RowCrossings<Wide> crossings;
      int64_t at;
      if (!crossings.Set(v) || !crossings.Find(y, z, &at)) continue;
      open = !open;
      if (at < row.hi[0]) flips ^= 1u << (Max<int64_t>(at, begin) - begin);
    }
    return open ? 0 : ParityUntil(flips);
  }

  // Returns the bits of a row of a box, where bit i is voxel box.lo[0] + i. Requires: the box lies
  // in the bounds and has at most a tile's 16 voxels along x.
  VOXELD_HD static uint32_t RowIn(const Source& source, const Box3& box, int32_t y, int32_t z) {
    const uint32_t bits = InsideAround(source, box.lo[0], y, z) >> (box.lo[0] & 31);
    const int32_t n = box.hi[0] - box.lo[0];
    return n < 32 ? bits & ((1u << n) - 1) : bits;
  }

  template <class Emit>
  VOXELD_HD static void EmitTiles(const Source& source, uint32_t i, const TileGrid& grid,
                                  Emit&& emit) {
    const bool noted = source.inside_tiles != nullptr;
    if (noted && source.inside_tiles[i] == 0) return;
    EmitTilesOfBox(BlockOf(source, i), grid, [&](uint32_t tile) {
      const Box3 box = Intersect(grid.VoxelsOf(tile), source.solid.bounds);
      if (noted || source.inside == nullptr || HasAny(source, box)) emit(tile);
    });
  }

  // Requires: the box lies within a tile, so no row crosses words.
  template <class Emit>
  VOXELD_HD static void EmitVoxels(const Source& source, uint32_t i, const Box3& box, Emit&& emit) {
    const Box3 block = Intersect(box, BlockOf(source, i));
    const uint32_t rgb = source.UniformColor();
    for (int32_t z = block.lo[2]; z < block.hi[2]; ++z) {
      for (int32_t y = block.lo[1]; y < block.hi[1]; ++y) {
        uint32_t bits = IsEmpty(block) ? 0 : RowIn(source, block, y, z);
        for (int32_t x = block.lo[0]; bits != 0; bits >>= 1, ++x) {
          if ((bits & 1) != 0) emit(x, y, z, rgb);
        }
      }
    }
  }

 private:
  VOXELD_HD static bool HasAny(const Source& source, const Box3& box) {
    if (IsEmpty(box)) return false;
    for (int32_t z = box.lo[2]; z < box.hi[2]; ++z) {
      uint32_t any = 0;  // the rows do not depend on each other
      for (int32_t y = box.lo[1]; y < box.hi[1]; ++y) any |= RowIn(source, box, y, z);
      if (any != 0) return true;
    }
    return false;
  }
};

}  // namespace voxeld::gpu
