// Draws thin lines without lists: each block of threads tests all of them, and cuts them to its
// region.
#pragma once

#include "gpu/cuda/lines-inl.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/cuda/spans-inl.h"

namespace voxeld::gpu::cuda {

// Finds the line's voxels in the region at `at`: k to end − 1, as WalkThin finds them. Returns
// false if it has none.
__device__ inline bool CutToRegion(const ThinLine& line, const int32_t at[3], int32_t& k,
                                   int32_t& end) {
  k = 0;
  end = line.n + 1;
  int32_t from[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int shift = 8 + RegionBits(a);
    from[a] = line.s[a] >> shift;
    const int32_t to = (line.s[a] + line.d[a]) >> shift;
    if (Min(from[a], to) > at[a] || Max(from[a], to) < at[a]) return false;
  }
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const int32_t d = line.d[a];
    ThinAxis axis;
    if (from[a] != at[a]) {  // its next box is this region
      axis.Begin(line, a, d < 0 ? at[a] + 1 : at[a] - 1, RegionBits(a));
      k = Max(k, axis.next);
    }
    axis.Begin(line, a, at[a], RegionBits(a));
    end = Min(end, axis.next);
  }
  return k < end;
}

// Called by the whole block.
static __device__ __noinline__ void DrawUnsorted(const ThinLine* lines, const ThinTrack* tracks,
                                                 const uint32_t* ends, uint32_t count,
                                                 const RegionGrid* regions) {
  SpanScratch& scratch = SharedSpans();
  uint32_t& found = scratch.spans_found;
  int32_t at[3];
  regions->RegionCoordinates(SharedRegion().region, at);
  if (threadIdx.x == 0) found = 0;
  __syncthreads();
  for (uint64_t first = 0; first < count; first += kDrawThreads) {
    const uint64_t i = first + threadIdx.x;
    if (i < count) {
      const ThinLine line = LoadLine(&lines[i]);
      int32_t k, end;
      if (line.word != 0 && CutToRegion(line, at, k, end)) {
        const bool mixed = ends != nullptr && ends[i] != line.word;
        scratch.spans[atomicAdd(&found, 1u)] =
            LineSpan::Of(static_cast<uint32_t>(i), k, end - k, 0, mixed);
      }
    }
    __syncthreads();
    const uint32_t here = found;
    // Draw when another round might not fit.
    if (here > kMostSpans - kDrawThreads || first + kDrawThreads >= count) {
      DrawHeld(tracks, ends, here);
      __syncthreads();
      if (threadIdx.x == 0) found = 0;
    }
    __syncthreads();
  }
}

}  // namespace voxeld::gpu::cuda
