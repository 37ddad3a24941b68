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

__device__ inline void DrawSpan(const DrawView& view, const LineBatchView& batch,
                                const ThinLine& line, LineSpan span, const int32_t at[3],
                                uint32_t* words) {
  const int32_t k = span.k();
  const ThinSteps steps =
      ThinSteps::At(line, k, __ldg(&view.reciprocals[line.n]), at, RegionBits(2));
  ThinCursor cursor(steps);
  const uint32_t count = span.count();
  const auto next = [&] {
    const uint32_t place = (cursor.voxel(2) << 5 | cursor.voxel(1)) << 5 | cursor.voxel(0);
    cursor.Next();
    return place;
  };
  if (span.mixed()) {
    const uint32_t end = batch.ends[span.line];
    for (uint32_t j = 0; j < count; ++j) {
      const uint32_t place = next();
      if (line.word == 0) continue;
      atomicMax(&words[place], MixWords(line.word, end, k + static_cast<int32_t>(j), line.n));
    }
    return;
  }
#pragma unroll 4
  for (uint32_t j = 0; j < count; ++j) atomicMax(&words[next()], line.word);
}

// The region's next segments of spans, from chunk `first` on, by the whole block; how many spans they
// have.
__device__ inline uint32_t FindSegments(const SpanLists& lists, uint32_t first, uint32_t last,
                                        uint32_t region, RegionScratch& scratch) {
  if (threadIdx.x < kSegments) {
    const uint32_t chunk = first + threadIdx.x;
    uint32_t count = 0;
    if (chunk < last) {
      const uint16_t* const offsets = lists.offsets +
                                      static_cast<size_t>(chunk) * (kRegionsInBlock + 1) +
                                      region % kRegionsInBlock;
      count = offsets[1] - offsets[0];
      scratch.segment_at[threadIdx.x] = lists.base[chunk] + offsets[0];
    }
    scratch.segment_first[threadIdx.x] = count;
  }
  __syncthreads();
  if (threadIdx.x < 32) {
    constexpr uint32_t kEach = kSegments / 32;
    uint32_t* const own = &scratch.segment_first[threadIdx.x * kEach];
    uint32_t counts[kEach], sum = 0;
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) sum += counts[e] = own[e];
    uint32_t before = sum;
    for (uint32_t lanes = 1; lanes < 32; lanes <<= 1) {
      const uint32_t other = __shfl_up_sync(kAllLanes, before, lanes);
      if (threadIdx.x >= lanes) before += other;
    }
    if (threadIdx.x == 31) scratch.segment_first[kSegments] = before;
    before -= sum;
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) {
      own[e] = before;
      before += counts[e];
    }
    if (threadIdx.x == 0) scratch.next_span = 0;
  }
  __syncthreads();
  return scratch.segment_first[kSegments];
}

// A warp draws spans `first` to first + count − 1 of those found, count ≤ kQueue: by length, so that
// its lanes have about as much to do.
__device__ inline void DrawQueue(const DrawView& view, const LineBatchView& batch, uint32_t first,
                                 uint32_t count, const int32_t at[3], RegionScratch& scratch) {
  constexpr uint32_t kEach = kQueue / 32;
  const uint32_t lane = threadIdx.x % 32, warp = threadIdx.x / 32;
  uint32_t* const buckets = scratch.buckets[warp];
  buckets[lane] = buckets[lane + 32] = 0;
  __syncwarp();
  const auto search = [&](uint32_t i) {
    uint32_t low = 0, high = kSegments;  // segment_first[low] ≤ i < segment_first[high]
    while (high - low > 1) {
      const uint32_t middle = (low + high) / 2;
      (scratch.segment_first[middle] <= i ? low : high) = middle;
    }
    return low;
  };
  // As a rule the spans lie in one segment and the 31 after it, whose beginnings the lanes have.
  const uint32_t low_segment = search(first);
  const uint32_t begins = scratch.segment_first[Min(low_segment + 1 + lane, kSegments)];
  const bool near = __shfl_sync(kAllLanes, begins, 31) >= first + count;
  const auto segment = [&](uint32_t i) {
    uint32_t after = 0;  // segments that begin at i or before
#pragma unroll
    for (uint32_t step = 16; step > 0; step /= 2) {
      if (__shfl_sync(kAllLanes, begins, after + step - 1) <= i) after += step;
    }
    return near ? low_segment + after : search(i);
  };
  uint32_t line[kEach], bits[kEach], rank[kEach];
#pragma unroll
  for (uint32_t e = 0; e < kEach; ++e) {
    const uint32_t i = lane + 32 * e;
    line[e] = bits[e] = rank[e] = 0;
    const uint32_t low = segment(Min(first + i, first + count - 1));
    if (i >= count) continue;
    const LineSpan span =
        batch.lists.spans[scratch.segment_at[low] + (first + i - scratch.segment_first[low])];
    line[e] = span.line;
    bits[e] = span.bits;
    rank[e] = atomicAdd(&buckets[span.mixed() ? kBuckets - 1 : span.count()], 1u);
  }
  __syncwarp();
  uint32_t low = buckets[2 * lane], high = buckets[2 * lane + 1], sum = low + high;
  for (uint32_t lanes = 1; lanes < 32; lanes <<= 1) {
    const uint32_t other = __shfl_up_sync(kAllLanes, sum, lanes);
    if (lane >= lanes) sum += other;
  }
  buckets[2 * lane] = sum - low - high;
  buckets[2 * lane + 1] = sum - high;
  __syncwarp();
#pragma unroll
  for (uint32_t e = 0; e < kEach; ++e) {
    if (lane + 32 * e >= count) continue;
    const LineSpan span{line[e], bits[e]};
    const uint32_t bucket = span.mixed() ? kBuckets - 1 : span.count();
    scratch.order[warp][buckets[bucket] + rank[e]] = static_cast<uint8_t>(lane + 32 * e);
  }
  __syncwarp();
  const auto take = [&](uint32_t i) {
    const uint32_t from = i + lane < count ? scratch.order[warp][i + lane] : 0;
    LineSpan span{0, 0};
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) {
      const uint32_t l = __shfl_sync(kAllLanes, line[e], from % 32);
      const uint32_t b = __shfl_sync(kAllLanes, bits[e], from % 32);
      if (from / 32 == e) span = {l, b};
    }
    return span;
  };
  // The next one's line is on its way while this one is drawn.
  LineSpan span = take(0);
  ThinLine drawn = LoadLine(&batch.lines[span.line]);
  for (uint32_t i = 0; i < count; i += 32) {
    LineSpan next = span;
    ThinLine coming = drawn;
    if (i + 32 < count) {
      next = take(i + 32);
      coming = LoadLine(&batch.lines[next.line]);
    }
    if (i + lane < count) DrawSpan(view, batch, drawn, span, at, scratch.words);
    __syncwarp();
    span = next;
    drawn = coming;
  }
}

// By the whole block; warps take what comes next.
__device__ inline void DrawSpans(const DrawView& view, const LineBatchView& batch,
                                 RegionScratch& scratch) {
  const uint32_t region = scratch.region;
  int32_t at[3];
  view.regions.RegionCoordinates(region, at);
  const uint32_t first = batch.lists.chunk_begin[region / kRegionsInBlock];
  const uint32_t last = batch.lists.chunk_begin[region / kRegionsInBlock + 1];
  for (uint32_t chunk = first; chunk < last; chunk += kSegments) {
    const uint32_t count = FindSegments(batch.lists, chunk, last, region, scratch);
    // Shared by all warps alike.
    constexpr uint32_t kTogether = kQueue * kDrawWarps;
    const uint32_t rounds = Max((count + kTogether - 1) / kTogether, 1u) * kDrawWarps;
    const uint32_t queue = ((count + rounds - 1) / rounds + 31) & ~31u;
    for (;;) {
      uint32_t next = 0;
      if (threadIdx.x % 32 == 0) next = atomicAdd(&scratch.next_span, queue);
      next = __shfl_sync(kAllLanes, next, 0);
      if (next >= count) break;
      DrawQueue(view, batch, next, Min(queue, count - next), at, scratch);
    }
    __syncthreads();
  }
}

}  // namespace voxeld::gpu::cuda
