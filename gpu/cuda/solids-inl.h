// Raises boxes, spheres and cylinders into a region's words.
#pragma once

#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {

// Draws a solid in a tile, by the whole block: rows of inside voxels, with a rim, and then the
// visible ones among them.
template <class Shape>
__device__ void DrawSolid(const TableEntry& entry, const Box3& box, uint32_t* words,
                          SolidBlock& block) {
  const Solid& s = entry.source.solid;
  const Box3 part = Intersect(box, s.bounds);
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, entry.source.UniformColor());
  if (threadIdx.x == 0 && Contains(box, s.origin[0], s.origin[1], s.origin[2]) &&
      !IsInside<Shape>(s, s.origin[0], s.origin[1], s.origin[2])) {
    atomicMax(
        &words[IndexInRegion(static_cast<int32_t>(s.origin[0]), static_cast<int32_t>(s.origin[1]),
                             static_cast<int32_t>(s.origin[2]))],
        word);
  }
  if (IsEmpty(part)) return;  // the same for every thread
  int64_t lo[3], hi[3];
  for (int a = 0; a < 3; ++a) {
    lo[a] = static_cast<int64_t>(part.lo[a]) - 1;
    hi[a] = static_cast<int64_t>(part.hi[a]) + 1;
  }
  const int32_t rows_y = static_cast<int32_t>(hi[1] - lo[1]);
  const int32_t rows = rows_y * static_cast<int32_t>(hi[2] - lo[2]);
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < rows;
       i += static_cast<int32_t>(kDrawThreads)) {
    block.FillRow<Shape>(s, lo, hi, lo[1] + i % rows_y, lo[2] + i / rows_y);
  }
  __syncthreads();
  const int32_t inner_y = part.hi[1] - part.lo[1];
  const int32_t inner = inner_y * (part.hi[2] - part.lo[2]);
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < inner;
       i += static_cast<int32_t>(kDrawThreads)) {
    const int32_t y = i % inner_y, z = i / inner_y;
    uint32_t row = block.bits[z + 1][y + 1];
    if (row != 0 && entry.record.fill == Fill::kSurface) {
      row &= ~block.Enclosed(y + 1, z + 1, entry.record.rule);
    }
    for (int32_t x = part.lo[0]; x < part.hi[0]; ++x) {
      if ((row >> (x - part.lo[0] + 1)) & 1u) {
        atomicMax(&words[IndexInRegion(x, part.lo[1] + y, part.lo[2] + z)], word);
      }
    }
  }
  __syncthreads();
}

// Returns those voxels whose neighbours are all inside, for a plane's rows of bits, one per lane,
// as SolidBlock::Enclosed. Called by a warp.
__device__ inline uint32_t EnclosedInPlane(uint32_t below, uint32_t here, uint32_t above,
                                           SurfaceRule rule) {
  const uint32_t lane = threadIdx.x % 32;
  const auto both = [&](uint32_t rows) {  // those next to it along y
    return __shfl_sync(kAllLanes, rows, lane - 1 & 31) &
           __shfl_sync(kAllLanes, rows, lane + 1 & 31);
  };
  if (rule == SurfaceRule::kThin) return here << 1 & here >> 1 & both(here) & below & above;
  const auto along = [](uint32_t row) { return row & row << 1 & row >> 1; };
  const uint32_t rows = along(below) & along(here) & along(above);
  return rows & both(rows);
}

// Draws a solid in a tile, by a warp: a plane at a time, of which lane y has row y, with voxel x −
// x0 as a bit. As many rows as fit are handled at once, with a lane for each voxel.
template <class Shape>
__device__ void DrawSolidByWarp(const TableEntry& entry, const Box3& box, uint32_t* words) {
  const Solid& s = entry.source.solid;
  const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
  const Box3 part = Intersect(box, s.bounds);
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, entry.source.UniformColor());
  if (lane == 0 && Contains(box, s.origin[0], s.origin[1], s.origin[2]) &&
      !IsInside<Shape>(s, s.origin[0], s.origin[1], s.origin[2])) {
    atomicMax(
        &words[IndexInRegion(static_cast<int32_t>(s.origin[0]), static_cast<int32_t>(s.origin[1]),
                             static_cast<int32_t>(s.origin[2]))],
        word);
  }
  if (IsEmpty(part)) return;  // the same for every lane
  const int32_t x0 = part.lo[0] - 1, width = part.hi[0] - part.lo[0] + 2;
  const int32_t y0 = part.lo[1] - 1, height = part.hi[1] - part.lo[1] + 2;
  const int32_t each = 32 / width;  // rows at once
  const int32_t mine = lane / width, x = x0 + lane % width;
  const float dx = s.Distance(0, x);
  const bool x_within = mine < each && x >= s.bounds.lo[0] && x < s.bounds.hi[0];
  const uint32_t inner = (1u << (width - 1)) - 2;  // without the rim
  const bool has_row = lane >= 1 && lane < height - 1;
  uint32_t below = 0, here = 0;
  for (int32_t z = part.lo[2] - 1; z <= part.hi[2]; ++z) {
    uint32_t above = 0;
    if (z >= s.bounds.lo[2] && z < s.bounds.hi[2]) {  // the same for every lane
      const float dz = s.Distance(2, z);
      for (int32_t first = 0; first < height; first += each) {
        const int32_t y = y0 + first + mine;
        bool inside =
            x_within && first + mine < height && y >= s.bounds.lo[1] && y < s.bounds.hi[1];
        if (inside) {
          float q[3];
          s.Canonical(dx, s.Distance(1, y), dz, q);
          inside = Shape::Contains(q);
        }
        const uint32_t bits = __ballot_sync(kAllLanes, inside);
        const int32_t row = lane - first;
        if (row >= 0 && row < each) above = bits >> row * width & ((inner << 1) | 3u);
      }
    }
    uint32_t seen = here;
    if (entry.record.fill == Fill::kSurface) {
      seen &= ~EnclosedInPlane(below, here, above, entry.record.rule);
    }
    seen = has_row && z > part.lo[2] ? seen & inner : 0;
    while (seen != 0) {
      const int32_t bit = __ffs(static_cast<int>(seen)) - 1;
      seen &= seen - 1;
      atomicMax(&words[IndexInRegion(x0 + bit, y0 + lane, z - 1)], word);
    }
    below = here;
    here = above;
  }
  __syncwarp();
}

__device__ inline void DrawSolidByWarp(const TableEntry& entry, const Box3& box, uint32_t* words) {
  switch (entry.record.kind) {
    case PrimitiveKind::kBox:
      return DrawSolidByWarp<Box>(entry, box, words);
    case PrimitiveKind::kSphere:
      return DrawSolidByWarp<Sphere>(entry, box, words);
    default:
      return DrawSolidByWarp<Cylinder>(entry, box, words);
  }
}

// Solids so small that a warp computes the whole part of one in a region as columns along z, with a
// rim of one voxel.
struct SmallSolids {
  static constexpr int32_t kReach = 8;  // voxels from the origin's voxel
  static constexpr int32_t kSide = 2 * kReach + 1;
  static constexpr uint32_t kColumns = (kSide + 2) * (kSide + 2);

  // For each warp, x fastest: bit i is voxel i − 1 along z of the drawn part.
  uint32_t columns[kDrawWarps][kColumns];

  __device__ static bool Has(const Solid& s) {
    for (int a = 0; a < 3; ++a) {
      if (s.origin[a] - s.bounds.lo[a] > kReach || s.bounds.hi[a] - s.origin[a] > kReach + 1) {
        return false;
      }
    }
    return true;
  }
};

// Returns the inside voxels among `count` voxels along z, as bits from `bit` on. base: the part of
// canonical coordinates that does not change; step: their change with dz.
template <class Shape>
__device__ inline uint32_t InsideColumn(const float base[3], const float step[3], float dz,
                                        uint32_t bit, int32_t count) {
  uint32_t inside = 0;
#pragma unroll 3
  for (; count > 0; --count) {
    float q[3];
    for (int r = 0; r < 3; ++r) q[r] = base[r] + step[r] * dz;
    if (Shape::Contains(q)) inside |= bit;
    bit <<= 1;
    dz += 1.0f;  // exact, because it is near the origin
  }
  return inside;
}

__device__ inline uint32_t InsideColumn(PrimitiveKind kind, const float base[3],
                                        const float step[3], float dz, uint32_t bit,
                                        int32_t count) {
  switch (kind) {
    case PrimitiveKind::kBox:
      return InsideColumn<Box>(base, step, dz, bit, count);
    case PrimitiveKind::kSphere:
      return InsideColumn<Sphere>(base, step, dz, bit, count);
    default:
      return InsideColumn<Cylinder>(base, step, dz, bit, count);
  }
}

// Returns those voxels of a column whose neighbours are all inside; the column is at `at` among
// others, `width` in a row.
__device__ inline uint32_t EnclosedInColumn(const uint32_t* at, int32_t width, SurfaceRule rule) {
  const auto along = [](uint32_t column) { return column & column << 1 & column >> 1; };
  if (rule == SurfaceRule::kThin) return along(*at) & at[-1] & at[1] & at[-width] & at[width];
  uint32_t all = kAllLanes;
  for (int32_t dy = -width; dy <= width; dy += width) {
    for (int32_t dx = -1; dx <= 1; ++dx) all &= along(at[dy + dx]);
  }
  return all;
}

// bits: in the format of SmallSolids; place: the index of bit 0.
__device__ inline void RaiseColumn(uint32_t* words, uint32_t place, uint32_t bits, uint32_t word) {
  for (; bits != 0; bits &= bits - 1) {
    const uint32_t bit = static_cast<uint32_t>(__ffs(static_cast<int>(bits))) - 1;
    atomicMax(&words[place + (bit << 10)], word);
  }
}

// Draws a small solid in a region, by a warp. columns: the warp's.
__device__ inline void DrawSmallSolid(const TableEntry& entry, const Box3& region, uint32_t* words,
                                      uint32_t* columns) {
  const Solid& s = entry.source.solid;
  const Box3 part = Intersect(region, s.bounds);
  if (IsEmpty(part)) return;  // the same for every lane
  const bool surface = entry.record.fill == Fill::kSurface;
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, entry.source.UniformColor());
  // Which voxels are tested: for a surface the rim too, where voxels beyond the bounds are not
  // inside.
  const int32_t rim = surface ? 1 : 0;
  int32_t lo[3], hi[3], origin[3], rest[3];
  for (int a = 0; a < 3; ++a) {
    lo[a] = Max(part.lo[a] - rim, s.bounds.lo[a]);
    hi[a] = Min(part.hi[a] + rim, s.bounds.hi[a]);
    origin[a] = static_cast<int32_t>(s.origin[a]);
    rest[a] = kHalfVoxel - static_cast<int32_t>(s.rest[a]);
  }
  // The same as Solid::Distance, in 32 bits.
  const auto distance = [&](int a, int32_t voxel) {
    return static_cast<float>((voxel - origin[a]) * static_cast<int32_t>(kUnitsPerVoxel) +
                              rest[a]) *
           0.00390625f;
  };
  const int32_t begin = part.lo[2] - 1, height = part.hi[2] - part.lo[2];
  const uint32_t drawn = (2u << height) - 2;
  const uint32_t origin_bit =
      Contains(part, origin[0], origin[1], origin[2]) ? 1u << (origin[2] - begin) : 0;
  const int32_t width = hi[0] - lo[0], count = width * (hi[1] - lo[1]), row = width + 2;
  const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
  if (surface) {
    for (int32_t i = lane; i < row * (hi[1] - lo[1] + 2); i += 32) columns[i] = 0;
    __syncwarp();
  }
  const int32_t per = 65536 / width + 1;  // i·per / 65536 is i / width for these small numbers
  const float step[3] = {s.inverse[0][2], s.inverse[1][2], s.inverse[2][2]};
  const float dz = distance(2, lo[2]);
  for (int32_t i = lane; i < count; i += 32) {
    const int32_t j = i * per >> 16, x = lo[0] + i - j * width, y = lo[1] + j;
    const float dx = distance(0, x), dy = distance(1, y);
    float base[3];
    for (int r = 0; r < 3; ++r) base[r] = s.inverse[r][0] * dx + s.inverse[r][1] * dy;
    const uint32_t inside =
        InsideColumn(entry.record.kind, base, step, dz, 1u << (lo[2] - begin), hi[2] - lo[2]);
    uint32_t raised = x == origin[0] && y == origin[1] ? origin_bit & ~inside : 0;
    if (surface) {
      columns[(j + 1) * row + i - j * width + 1] = inside;
    } else {
      raised |= inside;
    }
    RaiseColumn(words, IndexInRegion(x, y, begin + 1) - (1u << 10), raised, word);
  }
  if (!surface) return;
  __syncwarp();
  for (int32_t i = lane; i < count; i += 32) {
    const int32_t j = i * per >> 16, x = lo[0] + i - j * width, y = lo[1] + j;
    if (x < part.lo[0] || x >= part.hi[0] || y < part.lo[1] || y >= part.hi[1]) continue;
    const uint32_t* const at = columns + (j + 1) * row + i - j * width + 1;
    const uint32_t seen = *at & drawn & ~EnclosedInColumn(at, row, entry.record.rule);
    RaiseColumn(words, IndexInRegion(x, y, begin + 1) - (1u << 10), seen, word);
  }
  __syncwarp();
}

}  // namespace voxeld::gpu::cuda
