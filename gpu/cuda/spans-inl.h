// Raises the spans of thin lines into a region's words.
#pragma once

#include "gpu/cuda/lines-inl.h"
#include "gpu/cuda/region_scratch-inl.h"

namespace voxeld::gpu::cuda {

// The same as MixColors for words' colours, if both have the same priority and neither erases.
__device__ inline uint32_t MixWords(uint32_t start, uint32_t end, int32_t k, int32_t n) {
  const uint32_t mixed =
      MixColors(Deinterleave(start & kColorMask), Deinterleave(end & kColorMask), k, n);
  return (start & ~kColorMask) | Interleave(mixed);
}

// Loads everything except n: the compiler would wait for an unused register when it is reused.
__device__ inline ThinTrack LoadTrack(const ThinTrack* track) {
  const uint4 a = __ldg(reinterpret_cast<const uint4*>(track->axis));
  const uint2 b = __ldg(reinterpret_cast<const uint2*>(&track->axis[2]));
  return {{static_cast<uint64_t>(a.y) << 32 | a.x, static_cast<uint64_t>(a.w) << 32 | a.z,
           static_cast<uint64_t>(b.y) << 32 | b.x},
          __ldg(&track->word),
          0};
}

// The words of the region, which are raised. On a device it uses the device's own instructions: the
// compiler would compute the address in shared memory again for each word, and branch around those
// that are not raised.
class RegionWords {
 public:
#if defined(__CUDA_ARCH__)
  __device__ explicit RegionWords(uint32_t* words)
      : at_(static_cast<uint32_t>(__cvta_generic_to_shared(words))) {
    asm volatile("" : "+r"(at_));
  }
  __device__ void Raise(const ThinCursor& cursor, uint32_t word) const {
    asm volatile("red.shared.max.u32 [%0], %1;" ::"r"(At(cursor)), "r"(word) : "memory");
  }
  // Raises the voxel at that index in the region.
  __device__ void RaiseAt(uint32_t voxel, uint32_t word) const {
    asm volatile("red.shared.max.u32 [%0], %1;" ::"r"(at_ + voxel * 4), "r"(word) : "memory");
  }
  // Does so if kLess < count.
  template <uint32_t kLess>
  __device__ void RaiseIf(uint32_t count, const ThinCursor& cursor, uint32_t word) const {
    asm volatile(
        "{ .reg .pred more; setp.gt.u32 more, %0, %1; @more red.shared.max.u32 [%2], %3; }" ::"r"(
            count),
        "n"(kLess), "r"(At(cursor)), "r"(word)
        : "memory");
  }

 private:
  __device__ uint32_t At(const ThinCursor& cursor) const {
    return at_ + IndexOf(cursor) * sizeof(uint32_t);
  }
  uint32_t at_;
#else
  __device__ explicit RegionWords(uint32_t* words) : words_(words) {}
  __device__ void Raise(const ThinCursor& cursor, uint32_t word) const {
    RaiseAt(IndexOf(cursor), word);
  }
  __device__ void RaiseAt(uint32_t voxel, uint32_t word) const { atomicMax(&words_[voxel], word); }
  template <uint32_t kLess>
  __device__ void RaiseIf(uint32_t count, const ThinCursor& cursor, uint32_t word) const {
    if (count > kLess) Raise(cursor, word);
  }

 private:
  uint32_t* words_;
#endif

 public:
  __device__ static uint32_t IndexOf(const ThinCursor& cursor) {
    const uint32_t row = __funnelshift_l(cursor.at[1], cursor.voxel(2), TrackBits(1));
    return __funnelshift_l(cursor.at[0], row, TrackBits(0));
  }
};

// Draws a span of a line with a colour gradient, by its lane alone.
static __device__ __noinline__ void DrawMixed(const ThinTrack* of, uint32_t end, LineSpan span) {
  const ThinTrack track = LoadTrack(of);
  if (track.word == 0) return;
  uint32_t* const words = SharedRegion().words;
  const int32_t k = span.k(), count = static_cast<int32_t>(span.count());
  ThinCursor cursor(track, k);
  for (int32_t j = 0; j < count; ++j, cursor.Next()) {
    atomicMax(&words[RegionWords::IndexOf(cursor)], MixWords(track.word, end, k + j, of->n));
  }
}

// Draws `left` voxels of one word from there on; 0 for a lane that has none. All lanes of a warp
// continue until the longest span ends.
__device__ inline void DrawGroup(ThinCursor cursor, uint32_t left, uint32_t word,
                                 const RegionWords& words) {
  constexpr uint32_t kAtOnce = 4;
  while (__all_sync(kAllLanes, left >= kAtOnce)) {
#pragma unroll
    for (uint32_t j = 0; j < kAtOnce; ++j, cursor.Next()) words.Raise(cursor, word);
    left -= kAtOnce;
  }
  while (__any_sync(kAllLanes, left != 0)) {
    words.RaiseIf<0>(left, cursor, word);
    cursor.Next();
    words.RaiseIf<1>(left, cursor, word);
    cursor.Next();
    words.RaiseIf<2>(left, cursor, word);
    cursor.Next();
    words.RaiseIf<3>(left, cursor, word);
    cursor.Next();
    left -= Min(left, kAtOnce);
  }
}

// Finds the region's next segments of spans, from chunk `first` on, up to kSegments. Called by the
// first warp.
__device__ inline void FindSegments(const SpanLists& lists, uint32_t first, uint32_t last,
                                    uint32_t region) {
  SpanScratch& scratch = SharedSpans();
  const uint32_t lane = threadIdx.x % 32;
  constexpr uint32_t kAtOnce = 4;
  const uint32_t segments = Min(last - first, kSegments);
  uint32_t sum = 0;
  for (uint32_t s = 0; s < segments; s += 32 * kAtOnce) {
    uint32_t count[kAtOnce], at[kAtOnce];
#pragma unroll
    for (uint32_t e = 0; e < kAtOnce; ++e) {
      const uint32_t segment = s + e * 32 + lane;
      count[e] = at[e] = 0;
      if (segment >= segments) continue;
      const uint16_t* const offsets = lists.offsets +
                                      static_cast<size_t>(first + segment) * (kRegionsInBlock + 1) +
                                      region % kRegionsInBlock;
      count[e] = offsets[1] - offsets[0];
      at[e] = lists.base[first + segment] + offsets[0];
    }
#pragma unroll
    for (uint32_t e = 0; e < kAtOnce; ++e) {
      if (s + e * 32 >= segments) break;
      const uint32_t before = sum + SumBefore(count[e]);
      const uint32_t segment = s + e * 32 + lane;
      if (segment < segments) {
        scratch.segment_first[segment] = before;
        scratch.segment_from[segment] = at[e] - before;
      }
      sum = __shfl_sync(kAllLanes, before + count[e], 31);
    }
  }
  if (lane == 0) {
    scratch.segments = segments;
    scratch.spans_found = sum;
  }
}

// A warp's spans, distributed over its lanes: number i is in spans[i / 32] of lane i % 32.
struct WarpSpans {
  LineSpan spans[kSpansOfLane];
  uint32_t count = 0;

  // Loads from span `first` of those found on, at least one and at most `most`, and prefetches
  // their tracks.
  __device__ void Fetch(const LineSpan* from, const ThinTrack* tracks, uint32_t first,
                        uint32_t most) {
    const SpanScratch& scratch = SharedSpans();
    const uint32_t lane = threadIdx.x % 32, segments = scratch.segments;
    // The segment that has the first span: the last one that begins there or before.
    constexpr uint32_t kStride = kSegments / 32;
    static_assert(kStride <= 32);
    const auto begins = [&](uint32_t segment) {
      return segment < segments && scratch.segment_first[segment] <= first;
    };
    uint32_t segment = kStride * static_cast<uint32_t>(
                                     __popc(__ballot_sync(kAllLanes, begins(lane * kStride))) - 1);
    segment += static_cast<uint32_t>(
        __popc(__ballot_sync(kAllLanes, lane < kStride && begins(segment + lane))) - 1);
    // Each lane has one of this segment and the next ones.
    const uint32_t mine = segment + lane;
    const uint32_t begin = mine < segments ? scratch.segment_first[mine] : scratch.spans_found;
    const uint32_t move = mine < segments ? scratch.segment_from[mine] : 0;
    const uint32_t known =
        segment + 32 < segments ? scratch.segment_first[segment + 32] : scratch.spans_found;
    count = Min(most, known - first);
    uint32_t at[kSpansOfLane];
#pragma unroll
    for (uint32_t e = 0; e < kSpansOfLane; ++e) {
      const uint32_t i = first + e * 32 + lane;
      uint32_t low = 0;
#pragma unroll
      for (uint32_t step = 16; step > 0; step /= 2) {
        if (__shfl_sync(kAllLanes, begin, low + step) <= i) low += step;
      }
      at[e] = __shfl_sync(kAllLanes, move, low) + i;
    }
#pragma unroll
    for (uint32_t e = 0; e < kSpansOfLane; ++e) {
      uint2 span = make_uint2(0, 0);
      if (e * 32 + lane < count) span = __ldcs(reinterpret_cast<const uint2*>(from) + at[e]);
      spans[e] = {span.x, span.y};
    }
#pragma unroll
    for (uint32_t e = 0; e < kSpansOfLane; ++e) {
      if (e * 32 + lane < count) AskFor(&tracks[spans[e].line]);
    }
  }

  // Sorts them into `sorted` by length, the longest first, so that lanes have equal work; spans
  // with a colour gradient come first.
  __device__ void Sort(uint32_t buckets[32], LineSpan* sorted) const {
    const uint32_t lane = threadIdx.x % 32;
    if (count <= 32) {
      if (lane < count) sorted[lane] = spans[0];
      return __syncwarp();
    }
    buckets[lane] = 0;
    __syncwarp();
    uint32_t rank[kSpansOfLane];
#pragma unroll
    for (uint32_t e = 0; e < kSpansOfLane; ++e) {
      if (e * 32 + lane < count) rank[e] = atomicAdd(&buckets[BucketOf(spans[e])], 1u);
    }
    __syncwarp();
    buckets[lane] = SumBefore(buckets[lane]);
    __syncwarp();
#pragma unroll
    for (uint32_t e = 0; e < kSpansOfLane; ++e) {
      if (e * 32 + lane < count) sorted[buckets[BucketOf(spans[e])] + rank[e]] = spans[e];
    }
    __syncwarp();
  }

 private:
  static_assert(kMaxSpan >> 1 < 31);
  __device__ static uint32_t BucketOf(LineSpan span) {
    return span.mixed() ? 0 : 31 - (span.count() >> 1);
  }
};

// Draws `count` spans, 32 at a time. Called by a warp.
__device__ inline void DrawSorted(const ThinTrack* tracks, const uint32_t* ends,
                                  const LineSpan* spans, uint32_t count, const RegionWords& words) {
  const uint32_t lane = threadIdx.x % 32;
  // The next spans' tracks are loaded while the current ones are drawn; in the first round none are
  // drawn.
  LineSpan span{0, 0};
  ThinTrack track{};
  for (uint32_t first = 0;; first += 32) {
    if (span.mixed()) DrawMixed(&tracks[span.line], ends[span.line], span);
    const ThinCursor cursor(track, span.k());
    const uint32_t word = track.word, voxels = span.mixed() ? 0 : span.count();
    const bool more = first < count;
    span = {0, 0};
    if (more) {
      if (first + lane < count) span = spans[first + lane];
      track = LoadTrack(&tracks[span.line]);
    }
    DrawGroup(cursor, voxels, word, words);
    if (!more) return;
  }
}

// Draws the spans that have been found: each warp for itself. Not inlined, so that it has all
// registers.
static __device__ __noinline__ void DrawFound(const LineSpan* from, const ThinTrack* tracks,
                                              const uint32_t* ends) {
  SpanScratch& scratch = SharedSpans();
  const RegionWords words(SharedRegion().words);
  const uint32_t warp = threadIdx.x / 32, found = scratch.spans_found;
  LineSpan* const sorted = &scratch.spans[warp * kSpansOfWarp];
  if (found == 0) return;
  // All warps have the same number, in as few parts as can be sorted at once.
  const uint32_t share = (found + kDrawThreads - 1) / kDrawThreads * 32;
  const uint32_t parts = (share + kSpansOfWarp - 1) / kSpansOfWarp;
  const uint32_t most = (share / 32 + parts - 1) / parts * 32;
  const uint32_t end = Min((warp + 1) * share, found);
  WarpSpans spans;
  for (uint32_t first = warp * share; first < end; first += spans.count) {
    spans.Fetch(from, tracks, first, Min(most, end - first));
    spans.Sort(scratch.buckets[warp], sorted);
    DrawSorted(tracks, ends, sorted, spans.count, words);
    __syncwarp();
  }
}

// Draws the `count` spans in SharedSpans().
static __device__ __noinline__ void DrawHeld(const ThinTrack* tracks, const uint32_t* ends,
                                             uint32_t count) {
  SpanScratch& scratch = SharedSpans();
  const uint32_t warp = threadIdx.x / 32, lane = threadIdx.x % 32;
  if (warp * kSpansOfWarp >= count) return;
  LineSpan* const sorted = &scratch.spans[warp * kSpansOfWarp];
  WarpSpans spans;
  spans.count = Min(count - warp * kSpansOfWarp, kSpansOfWarp);
#pragma unroll
  for (uint32_t e = 0; e < kSpansOfLane; ++e) {
    if (e * 32 + lane < spans.count) spans.spans[e] = sorted[e * 32 + lane];
  }
  __syncwarp();
  spans.Sort(scratch.buckets[warp], sorted);
  DrawSorted(tracks, ends, sorted, spans.count, RegionWords(SharedRegion().words));
}

// Draws the batch's spans in the region, if it has any there. Called by the whole block.
__device__ inline void DrawSpans(const LineBatchView& batch) {
  const uint32_t region = SharedRegion().region;
  // Both are loaded together.
  const bool any = batch.lists.Has(region);
  const uint32_t first = batch.lists.chunk_begin[region / kRegionsInBlock];
  const uint32_t last = any ? batch.lists.chunk_begin[region / kRegionsInBlock + 1] : first;
  for (uint32_t chunk = first; chunk < last; chunk += kSegments) {
    if (threadIdx.x < 32) FindSegments(batch.lists, chunk, last, region);
    __syncthreads();
    DrawFound(batch.lists.spans, batch.tracks, batch.ends);
    __syncthreads();
  }
}

}  // namespace voxeld::gpu::cuda
