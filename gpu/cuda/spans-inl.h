// The spans of thin lines, raised into a region's words.
#pragma once

#include "gpu/cuda/region_scratch-inl.h"

namespace voxeld::gpu::cuda {

// MixColors of words' colours, where both have the same priority and neither erases.
__device__ inline uint32_t MixWords(uint32_t start, uint32_t end, int32_t k, int32_t n) {
  const uint32_t mixed =
      MixColors(Deinterleave(start & kColorMask), Deinterleave(end & kColorMask), k, n);
  return (start & ~kColorMask) | Interleave(mixed);
}

// But for n: a register that is loaded and not used would be waited for where it is used anew.
__device__ inline ThinTrack LoadTrack(const ThinLine* line) {
  const ThinTrack& track = line->track;
  const uint4 a = __ldg(reinterpret_cast<const uint4*>(track.axis));
  const uint2 b = __ldg(reinterpret_cast<const uint2*>(&track.axis[2]));
  return {{static_cast<uint64_t>(a.y) << 32 | a.x, static_cast<uint64_t>(a.w) << 32 | a.z,
           static_cast<uint64_t>(b.y) << 32 | b.x},
          __ldg(&track.word),
          0};
}

__device__ inline uint32_t IndexOf(const ThinCursor& cursor) {
  return (cursor.voxel(2) * 32 + cursor.voxel(1)) * kRowStride + cursor.voxel(0);
}

// A span of a line that runs from colour to colour, by its lane alone.
static __device__ __noinline__ void DrawMixed(const ThinLine* line, uint32_t end, LineSpan span) {
  const ThinTrack track = LoadTrack(line);
  if (track.word == 0) return;
  uint32_t* const words = SharedRegion().words;
  const int32_t k = span.k(), count = static_cast<int32_t>(span.count());
  ThinCursor cursor(track, k);
  for (int32_t j = 0; j < count; ++j, cursor.Next()) {
    atomicMax(&words[IndexOf(cursor)], MixWords(track.word, end, k + j, line->track.n));
  }
}

// `left` voxels of one word from there on; 0 where a lane has none. All of a warp go on together
// until the longest ends.
__device__ inline void DrawGroup(ThinCursor cursor, uint32_t left, uint32_t word, uint32_t* words) {
  constexpr uint32_t kAtOnce = 4;
  while (__all_sync(kAllLanes, left >= kAtOnce)) {
#pragma unroll
    for (uint32_t j = 0; j < kAtOnce; ++j, cursor.Next()) {
      atomicMax(&words[IndexOf(cursor)], word);
    }
    left -= kAtOnce;
  }
  while (__any_sync(kAllLanes, left != 0)) {
#pragma unroll
    for (uint32_t j = 0; j < kAtOnce; ++j, cursor.Next()) {
      if (j < left) atomicMax(&words[IndexOf(cursor)], word);
    }
    left -= Min(left, kAtOnce);
  }
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
    uint32_t before = SumBefore(sum);
    if (threadIdx.x == 31) scratch.segment_first[kSegments] = before + sum;
#pragma unroll
    for (uint32_t e = 0; e < kEach; ++e) {
      own[e] = before;
      before += counts[e];
    }
  }
  __syncthreads();
  return scratch.segment_first[kSegments];
}

// Spans `first` to `first` + count − 1 of those found into shared memory, sorted by length, the
// longest first, so that a warp's lanes have as much to do.
__device__ inline void SortSpansHere(const LineBatchView& batch, uint32_t first, uint32_t count,
                                     RegionScratch& scratch) {
  // A warp goes over a segment; of some segments at once the first spans are asked for.
  const uint2* const from = reinterpret_cast<const uint2*>(batch.lists.spans);
  constexpr uint32_t kAtOnce = 4;
  static_assert(kSegments % (kAtOnce * kDrawWarps) == 0);
  for (uint32_t s = threadIdx.x / 32; s < kSegments; s += kAtOnce * kDrawWarps) {
    if (scratch.segment_first[s] >= first + count) break;
    uint32_t at[kAtOnce], high[kAtOnce];
    uint2 spans[kAtOnce];
#pragma unroll
    for (uint32_t e = 0; e < kAtOnce; ++e) {
      const uint32_t segment = s + e * kDrawWarps;
      at[e] = Max(scratch.segment_first[segment], first) + threadIdx.x % 32;
      high[e] = Min(scratch.segment_first[segment + 1], first + count);
      if (at[e] < high[e]) {
        spans[e] =
            __ldg(from + (scratch.segment_at[segment] - scratch.segment_first[segment] + at[e]));
      }
    }
#pragma unroll
    for (uint32_t e = 0; e < kAtOnce; ++e) {
      if (at[e] < high[e]) scratch.spans[at[e] - first] = {spans[e].x, spans[e].y};
    }
#pragma unroll 1
    for (uint32_t e = 0; e < kAtOnce; ++e) {
      const uint32_t segment = s + e * kDrawWarps;
      const uint32_t begin = scratch.segment_first[segment];
      const uint32_t end = Min(scratch.segment_first[segment + 1], first + count);
      for (uint32_t i = Max(begin, first) + threadIdx.x % 32 + 32; i < end; i += 32) {
        const uint2 span = __ldg(from + (scratch.segment_at[segment] - begin + i));
        scratch.spans[i - first] = {span.x, span.y};
      }
    }
  }
  if (threadIdx.x < kBuckets) scratch.buckets[threadIdx.x] = 0;
  __syncthreads();
  constexpr uint32_t kEach = kMostSpans / kDrawThreads;
  const auto bucket_of = [](LineSpan span) {
    return span.mixed() ? 0 : kBuckets - 1 - span.count();
  };
  LineSpan mine[kEach];
  uint32_t rank[kEach];
#pragma unroll
  for (uint32_t e = 0; e < kEach; ++e) {
    const uint32_t i = threadIdx.x + e * kDrawThreads;
    if (i >= count) continue;
    mine[e] = scratch.spans[i];
    rank[e] = atomicAdd(&scratch.buckets[bucket_of(mine[e])], 1u);
  }
  __syncthreads();
  if (threadIdx.x < 32) {
    const uint32_t low = scratch.buckets[2 * threadIdx.x],
                   high = scratch.buckets[2 * threadIdx.x + 1];
    const uint32_t before = SumBefore(low + high);
    scratch.buckets[2 * threadIdx.x] = before;
    scratch.buckets[2 * threadIdx.x + 1] = before + low;
  }
  __syncthreads();
#pragma unroll
  for (uint32_t e = 0; e < kEach; ++e) {
    if (threadIdx.x + e * kDrawThreads >= count) continue;
    scratch.spans[scratch.buckets[bucket_of(mine[e])] + rank[e]] = mine[e];
  }
  __syncthreads();
}

// Draws the `count` spans that lie in shared memory, 32 at a time. A function of its own, so that its
// loop has all registers.
static __device__ __noinline__ void DrawSorted(const ThinLine* lines, const uint32_t* ends,
                                               uint32_t count) {
  RegionScratch& scratch = SharedRegion();
  const uint32_t lane = threadIdx.x % 32;
  // To and fro, so that the warp that has the longest in one round has the shortest in the next.
  uint32_t group = threadIdx.x / 32, next = 2 * kDrawWarps - 1 - 2 * group;
  // The next group's tracks are on their way while one is drawn; in the first round that is none.
  LineSpan span{0, 0};
  ThinTrack track{};
  for (;;) {
    if (span.mixed()) DrawMixed(&lines[span.line], ends[span.line], span);
    const ThinCursor cursor(track, span.k());
    const uint32_t word = track.word, voxels = span.mixed() ? 0 : span.count();
    const bool more = group * 32 < count;
    span = {0, 0};
    if (more) {
      const uint32_t i = group * 32 + lane;
      if (i < count) span = scratch.spans[i];
      track = LoadTrack(&lines[span.line]);
    }
    DrawGroup(cursor, voxels, word, scratch.words);
    if (!more) return;
    group += next;
    next = 2 * kDrawWarps - next;
  }
}

// By the whole block.
__device__ inline void DrawSpans(const DrawView& view, const LineBatchView& batch,
                                 RegionScratch& scratch) {
  const uint32_t region = scratch.region;
  const uint32_t first = batch.lists.chunk_begin[region / kRegionsInBlock];
  const uint32_t last = batch.lists.chunk_begin[region / kRegionsInBlock + 1];
  for (uint32_t chunk = first; chunk < last; chunk += kSegments) {
    const uint32_t found = FindSegments(batch.lists, chunk, last, region, scratch);
    for (uint32_t span = 0; span < found; span += kMostSpans) {
      const uint32_t count = Min(found - span, kMostSpans);
      SortSpansHere(batch, span, count, scratch);
      DrawSorted(batch.lines, batch.ends, count);
      __syncthreads();
    }
  }
}

}  // namespace voxeld::gpu::cuda
