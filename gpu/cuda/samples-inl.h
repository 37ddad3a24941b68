// A grid of samples in a tile, by a block of threads: a voxel each.
#pragma once

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/samples.h"
#include "gpu/word.h"

namespace voxeld::gpu::cuda {

static __device__ __noinline__ void DrawSamples(const TableEntry& entry, const Box3& box,
                                                uint32_t* words) {
  const Box3 part = Intersect(box, entry.source.solid.bounds);
  if (IsEmpty(part)) return;  // the same for every thread
  const uint32_t nx = static_cast<uint32_t>(part.hi[0] - part.lo[0]),
                 ny = static_cast<uint32_t>(part.hi[1] - part.lo[1]),
                 nz = static_cast<uint32_t>(part.hi[2] - part.lo[2]);
  for (uint32_t i = threadIdx.x; i < nx * ny * nz; i += kDrawThreads) {
    const int32_t x = part.lo[0] + static_cast<int32_t>(i % nx),
                  y = part.lo[1] + static_cast<int32_t>(i / nx % ny),
                  z = part.lo[2] + static_cast<int32_t>(i / nx / ny);
    uint32_t rgb;
    if (!Samples::Covers(entry.source, x, y, z, &rgb)) continue;
    atomicMax(&words[IndexInRegion(x, y, z)], MakeWord(entry.priority, entry.erase != 0, rgb));
  }
}

}  // namespace voxeld::gpu::cuda
