// Boxes, spheres and cylinders, raised into a region's words.
#pragma once

#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/list.h"

namespace voxeld::gpu::cuda {

// A solid in a tile, by the whole block: rows of what is inside, with a rim, then what is seen of
// them.
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

// Of a plane's rows of bits, one a lane, those whose neighbours are all inside, as SolidBlock::Enclosed; by a warp.
__device__ inline uint32_t EnclosedInPlane(uint32_t below, uint32_t here, uint32_t above,
                                           SurfaceRule rule) {
  const uint32_t lane = threadIdx.x % 32;
  const auto both = [&](uint32_t rows) {  // those beside it along y
    return __shfl_sync(kAllLanes, rows, lane - 1 & 31) &
           __shfl_sync(kAllLanes, rows, lane + 1 & 31);
  };
  if (rule == SurfaceRule::kThin) return here << 1 & here >> 1 & both(here) & below & above;
  const auto along = [](uint32_t row) { return row & row << 1 & row >> 1; };
  const uint32_t rows = along(below) & along(here) & along(above);
  return rows & both(rows);
}

// A solid in a tile, by a warp: a plane at a time, of which lane y has row y, voxel x − x0 as a bit. As many rows as fit are
// looked at at once, a lane for each voxel.
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

}  // namespace voxeld::gpu::cuda
