// The inside of a mesh in a tile, by a block of threads: rows first, then their voxels.
#pragma once

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/filled.h"

namespace voxeld::gpu::cuda {

struct FilledScratch {
  uint32_t rows[kTileSize * kTileSize];  // [z][y] of the part: bit i is voxel lo[0] + i
};

static __device__ __noinline__ void DrawFilled(const TableEntry& entry, const Box3& box,
                                               uint32_t* words, FilledScratch& scratch) {
  const Source& source = entry.source;
  const Box3 part = Intersect(box, source.solid.bounds);
  if (IsEmpty(part)) return;  // the same for every thread
  const int32_t nx = part.hi[0] - part.lo[0], ny = part.hi[1] - part.lo[1],
                nz = part.hi[2] - part.lo[2];
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < ny * nz; i += kDrawThreads) {
    scratch.rows[i] = Filled::RowIn(source, part, part.lo[1] + i % ny, part.lo[2] + i / ny);
  }
  __syncthreads();
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, source.UniformColor());
  for (int32_t i = static_cast<int32_t>(threadIdx.x); i < nx * ny * nz; i += kDrawThreads) {
    const int32_t x = i % nx, row = i / nx;
    if ((scratch.rows[row] >> x & 1) == 0) continue;
    uint32_t& at =
        words[IndexInRegion(part.lo[0] + x, part.lo[1] + row % ny, part.lo[2] + row / ny)];
    at = Max(at, word);  // nobody else has this voxel now
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
