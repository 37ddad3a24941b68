// The spans of thin lines, raised into a region's words.
#pragma once

#include "gpu/cuda/region_scratch-inl.h"

namespace voxeld::gpu::cuda {

__device__ inline ThinLine LoadLine(const ThinLine* line) {
  const int4* const at = reinterpret_cast<const int4*>(line);
  const int4 a = __ldg(at), b = __ldg(at + 1);
  return {{a.x, a.y, a.z}, a.w, {b.x, b.y, b.z}, static_cast<uint32_t>(b.w)};
}

// MixColors of words' colours, where both have the same priority and neither erases.
__device__ inline uint32_t MixWords(uint32_t start, uint32_t end, int32_t k, int32_t n) {
  const uint32_t mixed =
      MixColors(Deinterleave(start & kColorMask), Deinterleave(end & kColorMask), k, n);
  return (start & ~kColorMask) | Interleave(mixed);
}

__device__ inline void DrawSpan(const DrawView& view, const LineBatchView& batch, LineSpan span,
                                const int32_t at[3], uint32_t* words) {
  const ThinLine line = LoadLine(&batch.lines[span.line]);
  const int32_t k = span.k();
  const ThinSteps steps =
      ThinSteps::At(line, k, __ldg(&view.reciprocals[line.n]), at, RegionBits(2));
  uint32_t x = steps.at[0], y = steps.at[1], z = steps.at[2];
  const uint32_t count = span.count();
  const auto place = [&] { return x >> 27 | (y >> 22 & 0x3E0) | (z >> 17 & 0x3C00); };
  if (span.mixed()) {
    const uint32_t end = batch.ends[span.line];
    for (uint32_t j = 0; j < count; ++j) {
      if (line.word != 0) {
        atomicMax(&words[place()], MixWords(line.word, end, k + static_cast<int32_t>(j), line.n));
      }
      x += steps.step[0], y += steps.step[1], z += steps.step[2];
    }
    return;
  }
#pragma unroll 4
  for (uint32_t j = 0; j < count; ++j) {
    atomicMax(&words[place()], line.word);
    x += steps.step[0], y += steps.step[1], z += steps.step[2];
  }
}

// By the whole block. Sorted by length first, so that a warp's lanes have about as much to do.
__device__ inline void DrawSpans(const DrawView& view, const LineBatchView& batch,
                                 RegionScratch& scratch) {
  const uint32_t region = scratch.region;
  const uint32_t first = batch.rows[region], last = batch.rows[region + 1];
  int32_t at[3];
  view.regions.RegionCoordinates(region, at);
  constexpr uint32_t kEach = kQueue / kDrawThreads;
  for (uint32_t base = first; base < last; base += kQueue) {
    const uint32_t count = Min(kQueue, last - base);
    if (threadIdx.x < kBuckets) scratch.buckets[threadIdx.x] = 0;
    __syncthreads();
    LineSpan mine[kEach];
    uint32_t rank[kEach];
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) {
      const uint32_t i = threadIdx.x + e * kDrawThreads;
      if (i < count) {
        mine[e] = batch.spans[base + i];
        const uint32_t bucket = mine[e].count() + (mine[e].mixed() ? 64 : 0);
        rank[e] = bucket << 16 | atomicAdd(&scratch.buckets[bucket], 1u);
      }
    }
    __syncthreads();
    if (threadIdx.x < 32) {
      uint32_t* const own = &scratch.buckets[threadIdx.x * (kBuckets / 32)];
      uint32_t sum = own[0] + own[1] + own[2] + own[3], before = sum;
      for (uint32_t lanes = 1; lanes < 32; lanes <<= 1) {
        const uint32_t other = __shfl_up_sync(kAllLanes, before, lanes);
        if (threadIdx.x >= lanes) before += other;
      }
      before -= sum;
      for (uint32_t b = 0; b < kBuckets / 32; ++b) {
        const uint32_t in = own[b];
        own[b] = before;
        before += in;
      }
    }
    __syncthreads();
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) {
      if (threadIdx.x + e * kDrawThreads < count) {
        scratch.queue[scratch.buckets[rank[e] >> 16] + (rank[e] & 0xFFFF)] = mine[e];
      }
    }
    __syncthreads();
    for (uint32_t i = threadIdx.x; i < count; i += kDrawThreads) {
      DrawSpan(view, batch, scratch.queue[i], at, scratch.words);
    }
    // The next round's buckets are cleared while others still draw: nobody reads them any more.
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
