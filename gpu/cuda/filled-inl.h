// Draws the inside of a mesh in a region, by a block of threads: a thread looks up a row, a warp
// raises a plane.
#pragma once

#include "gpu/cuda/draw_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/primitives/filled.h"

namespace voxeld::gpu::cuda {

// box: the region's voxels, or some of them.
static __device__ __noinline__ void DrawFilled(const TableEntry& entry, const Box3& box) {
  static_assert(RegionBits(0) == 5 && RegionBits(1) == 5 && kDrawWarps == 1u << RegionBits(2));
  const Source& source = entry.source;
  const Box3 part = Intersect(box, source.solid.bounds);
  if (IsEmpty(part)) return;  // the same for every thread
  const uint32_t lane = threadIdx.x % 32, plane = threadIdx.x / 32;
  int32_t at[3];  // the region's first voxel
  for (int a = 0; a < 3; ++a) at[a] = box.lo[a] & -(1 << RegionBits(a));
  const int32_t y = at[1] + static_cast<int32_t>(lane), z = at[2] + static_cast<int32_t>(plane);
  uint32_t row = 0;  // bit i: voxel i along x
  if (Contains(part, part.lo[0], y, z)) {
    const uint32_t first = static_cast<uint32_t>(part.lo[0] - at[0]),
                   beyond = static_cast<uint32_t>(32 - (part.hi[0] - at[0]));
    row = Filled::InsideAround(source, part.lo[0], y, z) & kAllLanes << first & kAllLanes >> beyond;
  }
  const uint32_t word = MakeWord(entry.priority, entry.erase != 0, source.UniformColor());
  uint32_t* const words = SharedRegion().words + (plane << 10 | lane);
  for (uint32_t left = __ballot_sync(kAllLanes, row != 0); left != 0; left &= left - 1) {
    const uint32_t r = static_cast<uint32_t>(__ffs(static_cast<int>(left))) - 1;
    if ((__shfl_sync(kAllLanes, row, r) >> lane & 1) == 0) continue;
    words[r << 5] = Max(words[r << 5], word);  // no other thread accesses this voxel now
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
