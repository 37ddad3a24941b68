// The inside of a mesh in a tile, by a block of threads: rows first, then their voxels.
#pragma once

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/filled.h"

namespace voxeld::gpu::cuda {

struct FilledScratch {
  uint32_t rows[kTileSize * kTileSize];  // [z][y] of the tile: bit i is its voxel i along x
};

static __device__ __noinline__ void DrawFilled(const TableEntry& entry, const Box3& box,
                                               uint32_t* words, FilledScratch& scratch) {
  static_assert(kTileSize == 16);
  const Source& source = entry.source;
  const Box3 part = Intersect(box, source.solid.bounds);
  if (IsEmpty(part)) return;  // the same for every thread
  for (uint32_t row = threadIdx.x; row < kTileSize * kTileSize; row += kDrawThreads) {
    const int32_t y = box.lo[1] + static_cast<int32_t>(row & 15),
                  z = box.lo[2] + static_cast<int32_t>(row >> 4);
    scratch.rows[row] = Contains(part, part.lo[0], y, z)
                            ? Filled::RowIn(source, part, y, z) << (part.lo[0] - box.lo[0])
                            : 0;
  }
  __syncthreads();
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, source.UniformColor());
  uint32_t* const at = words + IndexInRegion(box.lo[0], box.lo[1], box.lo[2]);
  const uint32_t x = threadIdx.x & 15;
#pragma unroll
  for (uint32_t row = threadIdx.x >> 4; row < kTileSize * kTileSize; row += kDrawThreads / 16) {
    if ((scratch.rows[row] >> x & 1) == 0) continue;
    uint32_t& voxel = at[x | (row & 15) << 5 | row >> 4 << 10];
    voxel = Max(voxel, word);  // nobody else has this voxel now
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
