// Raises points without thickness into a region's words.
#pragma once

#include "gpu/cuda/point_types.h"
#include "gpu/cuda/region_scratch-inl.h"
#include "gpu/cuda/spans-inl.h"

namespace voxeld::gpu::cuda {

// A chunk's points in a region are drawn by one thread if they are few, by a warp if they are more,
// and by all threads if they are many.
inline constexpr uint32_t kFewPointsOfChunk = 16;
inline constexpr uint32_t kPointsHeld = 6;  // loaded together
inline constexpr uint32_t kManyPointsOfChunk = 2048;

__device__ inline PlacedPoint LoadRecord(const PlacedPoint* record) {
  const uint2 two = __ldcs(reinterpret_cast<const uint2*>(record));
  return {two.x, two.y};
}

// Draws every `stride`-th of `count` records from the `first` one on.
__device__ inline void DrawRecords(const PlacedPoint* records, uint32_t first, uint32_t count,
                                   uint32_t stride, const RegionWords& words) {
  constexpr uint32_t kAtOnce = 4;
  for (uint32_t i = first; i < count; i += kAtOnce * stride) {
    PlacedPoint held[kAtOnce];
#pragma unroll
    for (uint32_t j = 0; j < kAtOnce; ++j) {
      if (i + j * stride < count) held[j] = LoadRecord(records + i + j * stride);
    }
#pragma unroll
    for (uint32_t j = 0; j < kAtOnce; ++j) {
      if (i + j * stride < count) words.RaiseAt(held[j].at, held[j].word);
    }
  }
}

// Draws the rows of chunks that are more than few, which threads have listed, by warps. Called by
// the whole block.
static __device__ __noinline__ void DrawManyPoints(const PlacedPoint* from, uint32_t count) {
  PointScratch& scratch = SharedPoints();
  if (threadIdx.x == 0) scratch.segments = 0;
  __syncthreads();
  if (count != 0) {
    const uint32_t segment = atomicAdd(&scratch.segments, 1u);
    scratch.from[segment] = from;
    scratch.count[segment] = count;
  }
  __syncthreads();
  const RegionWords words(SharedRegion().words);
  const uint32_t segments = scratch.segments;
  const uint32_t warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  for (uint32_t s = 0; s < segments; ++s) {
    const uint32_t here = scratch.count[s];
    if (here > kManyPointsOfChunk) {
      DrawRecords(scratch.from[s], threadIdx.x, here, kDrawThreads, words);
    } else if (s % kDrawWarps == warp) {
      DrawRecords(scratch.from[s], lane, here, 32, words);
    }
  }
  __syncthreads();
}

// Draws the batch's points in the region, if it has any there. Called by the whole block.
static __device__ __noinline__ void DrawPoints(const PointBatchView& batch) {
  const uint32_t region = SharedRegion().region;
  if (!batch.Has<true>(region)) return;
  const RegionWords words(SharedRegion().words);
  const uint32_t stride = PointStride(batch.within.drawn_count());
  const uint16_t* const offsets = batch.offsets + batch.within.NumberDrawn(region);
  for (uint32_t first = 0; first < batch.chunks; first += kDrawThreads) {
    const uint32_t chunk = first + threadIdx.x;
    const PlacedPoint* from = nullptr;
    uint32_t count = 0;
    if (chunk < batch.chunks) {
      const uint16_t* const place = offsets + static_cast<size_t>(chunk) * stride;
      const uint32_t begin = place[0];
      count = place[1] - begin;
      from = batch.records + batch.base[chunk] + begin;
    }
    const uint32_t few = count <= kFewPointsOfChunk ? count : 0;
    PlacedPoint held[kPointsHeld];
#pragma unroll
    for (uint32_t j = 0; j < kPointsHeld; ++j) {
      if (j < few) held[j] = LoadRecord(from + j);
    }
#pragma unroll
    for (uint32_t j = 0; j < kPointsHeld; ++j) {
      if (j < few) words.RaiseAt(held[j].at, held[j].word);
    }
    DrawRecords(from, kPointsHeld, few, 1, words);
    if (__syncthreads_or(few != count) != 0) DrawManyPoints(from, few != count ? count : 0);
  }
}

// Draws points without lists. Called by the whole block.
static __device__ __noinline__ void DrawUnsortedPoints(const PlacedPoint* points, uint32_t count) {
  const uint32_t region = SharedRegion().region;
  const RegionWords words(SharedRegion().words);
  for (uint64_t i = threadIdx.x; i < count; i += kDrawThreads) {
    const PlacedPoint point = LoadRecord(&points[i]);
    if (point.word != 0 && point.region() == region) words.RaiseAt(point.voxel(), point.word);
  }
  __syncthreads();
}

}  // namespace voxeld::gpu::cuda
