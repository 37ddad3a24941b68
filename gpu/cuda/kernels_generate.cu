#include <cuda_pipeline.h>

#include "gpu/cuda/generate_kernels.h"
#include "gpu/generate/cover.h"

namespace voxeld::gpu::cuda {
namespace {

using generate::CoordinateAt;
using generate::Cover;
using generate::FixedSegment;
using generate::Output;
using generate::Sampling;
using generate::Stride;
using generate::Voxel;
using generate::Walk;
// A warp's walks begin exactly where it enters a segment, or up to a round of steps before that, as
// if the segment extended backwards; each round adds a run of steps and one long one. Steps
// backwards subtract their rounding: a walk may be too small by one round's amount outside the
// segment, where it is not used, and inside it the bias is at least as large.
using Rules =
    generate::WalkRules<kGenerateRound + kGenerateMostRounds*(kGenerateRun + 1) + kGenerateRun>;

static_assert(Rules::kWalkZone - Rules::kTooLarge > kGenerateRound);

constexpr int kThreads = 32 * kGenerateWarps;

__global__ void PrepareRecords(GenerateView view) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= view.count) return;
  const FixedSegment g = view.segments[i];
  const int64_t n = static_cast<int64_t>(view.offsets[i + 1] - view.offsets[i]) - 1;
  const int64_t grain = generate::GrainOf(g);
  SegmentRecord record;
  record.steps = static_cast<uint32_t>(n);
  for (int a = 0; a < 3; ++a) {
    const Stride stride = Stride::Of(g.s[a], g.e[a], n);
    StepRecord& axis = record.axis[a];
    axis.step_fraction = stride.step_fraction;
    axis.whole = static_cast<uint32_t>(stride.whole);
    axis.step_whole = static_cast<uint32_t>(stride.step_whole);
    axis.fraction = static_cast<uint32_t>(stride.fraction >> 32);
    axis.bias = Rules::BiasOf(stride, n, grain);
    axis.round_step = Rules::StepOfMany(stride, kGenerateRound - kGenerateRun);
  }
  view.records[i] = record;
}

// Returns the segment that holds a voxel, between lo and hi.
__device__ uint32_t SegmentOf(const uint64_t* offsets, uint32_t lo, uint32_t hi, uint64_t voxel) {
  while (lo < hi) {
    const uint32_t middle = lo + (hi - lo + 1) / 2;
    if (offsets[middle] <= voxel) {
      lo = middle;
    } else {
      hi = middle - 1;
    }
  }
  return lo;
}

__global__ void FindFirstSegments(GenerateView view, uint64_t warp_voxels, uint64_t warps) {
  const uint64_t i = static_cast<uint64_t>(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i > warps) return;
  const uint64_t voxel = Min<uint64_t>(i * warp_voxels, view.voxels - 1);
  view.first_segments[i] = SegmentOf(view.offsets, 0, view.count - 1, voxel);
}

__device__ Stride StrideOf(const StepRecord& axis) {
  Stride stride;
  stride.fraction = static_cast<uint64_t>(axis.fraction) << 32;
  stride.step_fraction = axis.step_fraction;
  stride.whole = static_cast<int32_t>(axis.whole);
  stride.step_whole = static_cast<int32_t>(axis.step_whole);
  return stride;
}

// Computes a voxel of a segment with so many steps that strides may be inexact. Not inlined,
// because it needs registers.
__device__ __noinline__ Voxel LongExact(const FixedSegment* segment, const uint64_t* offset,
                                        uint32_t k) {
  const FixedSegment g = *segment;
  const int64_t n = static_cast<int64_t>(offset[1] - offset[0]) - 1;
  int32_t v[3];
  for (int a = 0; a < 3; ++a) {
    v[a] = CoordinateAt(Stride::Of(g.s[a], g.e[a], n), g.s[a], g.e[a], n, k);
  }
  return {v[0], v[1], v[2]};
}

// Computes a voxel for which a walk is doubtful. kLong: segments may have kStrideExact steps or
// more.
template <bool kLong>
__device__ Voxel ExactVoxel(const GenerateView& view, const SegmentRecord& record, uint32_t segment,
                            uint32_t k) {
  if (kLong && record.steps >= generate::kStrideExact) {
    return LongExact(view.segments + segment, view.offsets + segment, k);
  }
  uint64_t fraction = 0;
  return {StrideOf(record.axis[0]).At(k, &fraction), StrideOf(record.axis[1]).At(k, &fraction),
          StrideOf(record.axis[2]).At(k, &fraction)};
}

struct Walks {
  Walk axis[3];

  __device__ void Begin(const SegmentRecord& record, uint32_t k) {
    for (int a = 0; a < 3; ++a)
      axis[a] = Rules::From(StrideOf(record.axis[a]), k, record.axis[a].bias);
  }
  // Up to a round before the segment's first voxel, the walks begin as if the segment extended
  // backwards.
  __device__ void BeginNear(const SegmentRecord& record, int32_t k) {
    Begin(record, static_cast<uint32_t>(max(k, 0)));
    const auto before = static_cast<uint64_t>(max(-k, 0));
    for (int a = 0; a < 3; ++a) axis[a].at -= axis[a].step * before;
  }
  __device__ void Next() {
    for (int a = 0; a < 3; ++a) axis[a].at += axis[a].step;
  }
  __device__ Voxel voxel() const { return {axis[0].whole(), axis[1].whole(), axis[2].whole()}; }
  // Returns the least of all fractions and `other`.
  __device__ uint32_t least(uint32_t other) const {
    return __vimin3_u32(axis[0].fraction(), axis[1].fraction(), min(axis[2].fraction(), other));
  }
};

template <Output kOut>
__device__ void StoreOne(const Voxel& v, uint64_t at, void* out) {
  if constexpr (kOut == Output::kPacked) {
    static_cast<uint32_t*>(out)[at] = static_cast<uint32_t>(v.x) +
                                      (static_cast<uint32_t>(v.y) << 11) +
                                      (static_cast<uint32_t>(v.z) << 22);
  } else {
    const int32_t c[3] = {v.x, v.y, v.z};
    for (int a = 0; a < 3; ++a) {
      if constexpr (kOut == Output::kI32x3) static_cast<int32_t*>(out)[3 * at + a] = c[a];
      if constexpr (kOut == Output::kF32x3)
        static_cast<float*>(out)[3 * at + a] = __int2float_rn(c[a]);
      if constexpr (kOut == Output::kI16x3)
        static_cast<int16_t*>(out)[3 * at + a] = static_cast<int16_t>(c[a]);
    }
  }
}

__device__ uint32_t Bits(Output kind, int32_t c) {
  return kind == Output::kF32x3 ? __float_as_uint(__int2float_rn(c)) : static_cast<uint32_t>(c);
}

// Writes a warp's voxels, four per thread, to memory in whole lines: through shared memory, where
// they have their final layout.
template <Output kOut>
__device__ void StoreWarp(const Voxel (&v)[kGenerateRun], uint64_t warp_at, uint4* stage,
                          void* out) {
  const uint32_t lane = threadIdx.x % 32;
  if constexpr (kOut == Output::kPacked) {
    uint32_t p[kGenerateRun];
    for (int i = 0; i < kGenerateRun; ++i) {
      p[i] = static_cast<uint32_t>(v[i].x) + (static_cast<uint32_t>(v[i].y) << 11) +
             (static_cast<uint32_t>(v[i].z) << 22);
    }
    __stcs(reinterpret_cast<uint4*>(static_cast<uint32_t*>(out) + warp_at) + lane,
           make_uint4(p[0], p[1], p[2], p[3]));
  } else if constexpr (kOut == Output::kI16x3) {
    constexpr auto pair = [](int32_t low, int32_t high) {
      return (static_cast<uint32_t>(low) & 0xFFFF) | (static_cast<uint32_t>(high) << 16);
    };
    __syncwarp();
    auto* to = reinterpret_cast<uint2*>(stage) + 3 * lane;
    to[0] = make_uint2(pair(v[0].x, v[0].y), pair(v[0].z, v[1].x));
    to[1] = make_uint2(pair(v[1].y, v[1].z), pair(v[2].x, v[2].y));
    to[2] = make_uint2(pair(v[2].z, v[3].x), pair(v[3].y, v[3].z));
    __syncwarp();
    auto* line = reinterpret_cast<uint4*>(static_cast<int16_t*>(out) + 3 * warp_at);
    __stcs(line + lane, stage[lane]);
    if (lane < 16) __stcs(line + 32 + lane, stage[32 + lane]);
  } else {
    __syncwarp();
    uint4* to = stage + 3 * lane;
    to[0] =
        make_uint4(Bits(kOut, v[0].x), Bits(kOut, v[0].y), Bits(kOut, v[0].z), Bits(kOut, v[1].x));
    to[1] =
        make_uint4(Bits(kOut, v[1].y), Bits(kOut, v[1].z), Bits(kOut, v[2].x), Bits(kOut, v[2].y));
    to[2] =
        make_uint4(Bits(kOut, v[2].z), Bits(kOut, v[3].x), Bits(kOut, v[3].y), Bits(kOut, v[3].z));
    __syncwarp();
    auto* line = reinterpret_cast<uint4*>(static_cast<uint32_t*>(out) + 3 * warp_at);
    for (int i = 0; i < 3; ++i) __stcs(line + 32 * i + lane, stage[32 * i + lane]);
  }
}

// Writes the first `count` voxels of a thread's run.
template <Output kOut>
__device__ void StoreSome(const Voxel (&v)[kGenerateRun], uint64_t at, int32_t count, void* out) {
#pragma unroll
  for (int32_t i = 0; i < static_cast<int32_t>(kGenerateRun); ++i) {
    if (i < count) StoreOne<kOut>(v[i], at + static_cast<uint32_t>(i), out);
  }
}

// `warp_at`: the place of the warp's first voxel, counted from `out`; `end`: that of the first
// voxel that is not wanted.
template <Output kOut>
__device__ void Store(const Voxel (&v)[kGenerateRun], uint64_t warp_at, uint32_t lane_at,
                      uint64_t end, uint4* stage, void* out) {
  if (warp_at + kGenerateRound <= end) return StoreWarp<kOut>(v, warp_at, stage, out);
  const auto left = static_cast<int32_t>(end - warp_at);
  StoreSome<kOut>(v, warp_at + lane_at, left - static_cast<int32_t>(lane_at), out);
}

// Makes the voxels of a thread's run, voxels `at` and on of a warp's round, that lie in one
// segment: from `begin` to `end` of the round. kWhole: all of them do. The walks advance to the
// thread's run in the next round.
template <bool kWhole, bool kLong>
__device__ void MakePart(const GenerateView& view, const SegmentRecord& record, uint32_t segment,
                         int32_t begin, int32_t end, int32_t at, Walks& walks,
                         Voxel (&v)[kGenerateRun]) {
  constexpr auto kRun = static_cast<int32_t>(kGenerateRun);
  uint32_t least = 0xFFFFFFFF;
#pragma unroll
  for (int32_t i = 0; i < kRun; ++i) {
    if (kWhole || (at + i >= begin && at + i < end)) {
      v[i] = walks.voxel();
      least = walks.least(least);
    }
    walks.Next();
  }
  for (int a = 0; a < 3; ++a) walks.axis[a].at += record.axis[a].round_step;
  if (!Rules::Doubtful(least)) return;
#pragma unroll 1
  for (int32_t i = 0; i < kRun; ++i) {
    if (!kWhole && (at + i < begin || at + i >= end)) continue;
    const auto k = static_cast<uint32_t>(at + i - begin);
    if (k > record.steps) return;  // beyond the batch's last voxel
    const Voxel exact = ExactVoxel<kLong>(view, record, segment, k);
#pragma unroll
    for (int32_t j = 0; j < kRun; ++j) {  // arrays must not be indexed by a variable
      if (j == i) v[j] = exact;
    }
  }
}

// Makes a thread's run across the ends of segments.
template <bool kLong>
__device__ void MakeMixedRun(const GenerateView& view, uint32_t lo, uint32_t hi, uint64_t voxel,
                             Voxel (&v)[kGenerateRun]) {
  uint32_t segment = SegmentOf(view.offsets, lo, hi, voxel);
  SegmentRecord record = view.records[segment];
  auto k = static_cast<uint32_t>(voxel - view.offsets[segment]);
  Walks walks;
  walks.Begin(record, k);
#pragma unroll
  for (uint32_t i = 0; i < kGenerateRun; ++i) {
    v[i] = walks.voxel();
    if (Rules::Doubtful(walks.least(0xFFFFFFFF)))
      v[i] = ExactVoxel<kLong>(view, record, segment, k);
    if (voxel + i + 1 >= view.voxels) return;
    if (k < record.steps) {
      ++k;
      walks.Next();
    } else {
      record = view.records[++segment];
      k = 0;
      walks.Begin(record, 0);
    }
  }
}

__device__ void MakeCoverRun(const GenerateView& view, uint32_t lo, uint32_t hi, uint64_t voxel,
                             Voxel (&v)[kGenerateRun]) {
  uint32_t segment = SegmentOf(view.offsets, lo, hi, voxel);
  Cover cover = Cover::Of(view.segments[segment]);
  int64_t taken[3];
  cover.Find(static_cast<int64_t>(voxel - view.offsets[segment]), taken);
  for (uint32_t i = 0; i < kGenerateRun; ++i) {
    v[i] = cover.CellAfter(taken);
    const uint64_t next = voxel + i + 1;
    if (next >= view.voxels) return;
    if (next < view.offsets[segment + 1]) {
      cover.Step(taken);
    } else {
      cover = Cover::Of(view.segments[++segment]);
      taken[0] = taken[1] = taken[2] = 0;
    }
  }
}

// The position of a warp: the segment of its next voxel, whose record is in shared memory, and the
// end of the segment after it, whose record is being copied there.
class WarpPlace {
 public:
  __device__ WarpPlace(const GenerateView& view, SegmentRecord (&slots)[2], uint32_t segment)
      : view_(view),
        slots_(slots),
        segment_(segment),
        begin_(view.offsets[segment]),
        end_(view.offsets[segment + 1]) {
    Fetch(segment, 0);
    LookAhead();
  }
  __device__ uint32_t segment() const { return segment_; }
  __device__ bool IsLast() const { return segment_ + 1 == view_.count; }
  // Returns where the segment begins (before the voxel: negative) or ends, counted from a voxel in
  // it or before it; distant ends are reported a little nearer.
  __device__ int32_t BeginFrom(uint64_t voxel) const {
    return static_cast<int32_t>(begin_ - voxel);
  }
  __device__ int32_t EndFrom(uint64_t voxel) const {
    return static_cast<int32_t>(min(end_ - voxel, static_cast<uint64_t>(1) << 29));
  }
  __device__ const SegmentRecord& record() const { return slots_[current_]; }
  // Advances to the next segment and returns its number of voxels (for many: slightly fewer).
  // Called by the whole warp.
  __device__ int32_t Advance() {
    ++segment_;
    begin_ = end_;
    end_ = next_end_;
    const int32_t voxels = EndFrom(begin_);
    current_ ^= 1;
    __syncwarp();  // no thread reads the old record
    LookAhead();
    return voxels;
  }

 private:
  // Waits for the pending copy, and starts the next.
  __device__ void LookAhead() {
    __pipeline_wait_prior(0);
    __syncwarp();
    const uint32_t next = min(segment_ + 1, view_.count - 1);
    next_end_ = view_.offsets[next + 1];
    Fetch(next, current_ ^ 1);
  }
  __device__ void Fetch(uint32_t segment, uint32_t slot) {
    constexpr uint32_t kParts = sizeof(SegmentRecord) / sizeof(uint4);
    const uint32_t lane = threadIdx.x % 32;
    if (lane < kParts) {
      __pipeline_memcpy_async(reinterpret_cast<uint4*>(&slots_[slot]) + lane,
                              reinterpret_cast<const uint4*>(&view_.records[segment]) + lane,
                              sizeof(uint4));
    }
    __pipeline_commit();
  }

  const GenerateView& view_;
  SegmentRecord (&slots_)[2];
  uint32_t segment_, current_ = 0;
  uint64_t begin_, end_, next_end_ = 0;
};

// Each warp makes a run of voxels, a round of kGenerateRound at a time: from segment to segment,
// or, if most are shorter than a round, each thread finds its own segment. `first` and `end` count
// from the batch's first voxel. Three blocks share a multiprocessor: too few registers cost more
// than missing warps.
template <Output kOut, bool kCover, bool kLong>
__global__ void __launch_bounds__(kThreads, kCover || kLong ? 2 : 3)
    GenerateVoxels(const __grid_constant__ GenerateView view, uint64_t first, uint64_t end,
                   void* out) {
  __shared__ uint4 stages[kGenerateWarps][kGenerateRound * 12 / 16];
  __shared__ SegmentRecord records[kGenerateWarps][2];
  uint4* const stage = stages[threadIdx.x / 32];
  const uint32_t warp_voxels = view.rounds * kGenerateRound;
  const uint64_t warp =
      first / warp_voxels + static_cast<uint64_t>(blockIdx.x) * kGenerateWarps + threadIdx.x / 32;
  uint64_t warp_at = warp * warp_voxels;
  if (warp_at >= end) return;
  const uint32_t lane_at = threadIdx.x % 32 * kGenerateRun;
  const uint32_t lowest = view.first_segments[warp], last = view.first_segments[warp + 1];
  Voxel v[kGenerateRun];
  if (kCover || last - lowest > 2 * view.rounds) {
    for (uint32_t round = 0; round < view.rounds && warp_at < end; ++round) {
      if (warp_at + lane_at < view.voxels) {
        if constexpr (kCover) {
          MakeCoverRun(view, lowest, last, warp_at + lane_at, v);
        } else {
          MakeMixedRun<kLong>(view, lowest, last, warp_at + lane_at, v);
        }
      }
      Store<kOut>(v, warp_at - first, lane_at, end - first, stage, out);
      warp_at += kGenerateRound;
    }
    return;
  }
  if constexpr (!kCover) {
    WarpPlace place(view, records[threadIdx.x / 32], lowest);
    constexpr auto kRound = static_cast<int32_t>(kGenerateRound);
    const auto at = static_cast<int32_t>(lane_at);
    // All of these count from the round's first voxel.
    int32_t part_begin = place.BeginFrom(warp_at), part_end = place.EndFrom(warp_at);
    auto left = static_cast<int32_t>(min(end - warp_at, static_cast<uint64_t>(warp_voxels)));
    uint64_t to = warp_at - first;
    Walks walks;
    walks.BeginNear(place.record(), at - part_begin);
    for (;;) {
      if (part_end >= kRound) {
        MakePart<true, kLong>(view, place.record(), place.segment(), part_begin, kRound, at, walks,
                              v);
      } else {
        for (;;) {
          MakePart<false, kLong>(view, place.record(), place.segment(), part_begin, part_end, at,
                                 walks, v);
          if (part_end >= kRound || place.IsLast()) break;
          part_begin = part_end;
          part_end += place.Advance();
          walks.BeginNear(place.record(), at - part_begin);
        }
      }
      if (left < kRound) break;
      StoreWarp<kOut>(v, to, stage, out);
      left -= kRound;
      to += kGenerateRound;
      if (left == 0) break;
      part_begin -= kRound;
      part_end -= kRound;
      if (part_end == 0) {
        part_begin = 0;
        part_end = place.Advance();
        walks.BeginNear(place.record(), at);
      }
    }
    __pipeline_wait_prior(0);  // no copy may arrive in shared memory after it is reused
    if (left > 0) StoreSome<kOut>(v, to + lane_at, left - at, out);
  }
}

template <Output kOut>
cudaError_t Launch(const GenerateView& view, Sampling sampling, uint64_t first, uint64_t count,
                   void* out, cudaStream_t stream) {
  const uint64_t each = view.warp_voxels() * kGenerateWarps;
  const auto blocks = static_cast<uint32_t>((count + each - 1) / each);
  const auto launch = [&]<bool kCover, bool kLong>() {
    GenerateVoxels<kOut, kCover, kLong>
        <<<blocks, kThreads, 0, stream>>>(view, first, first + count, out);
  };
  if (sampling == Sampling::kCover) {
    launch.template operator()<true, false>();
  } else if (view.most_steps >= generate::kStrideExact) {
    launch.template operator()<false, true>();
  } else {
    launch.template operator()<false, false>();
  }
  return cudaGetLastError();
}

}  // namespace

cudaError_t PrepareGenerate(const GenerateView& view, Sampling sampling, cudaStream_t stream) {
  if (sampling != Sampling::kCover) {
    PrepareRecords<<<(view.count + 127) / 128, 128, 0, stream>>>(view);
  }
  FindFirstSegments<<<static_cast<uint32_t>(view.warps() / 128 + 1), 128, 0, stream>>>(
      view, view.warp_voxels(), view.warps());
  return cudaGetLastError();
}

cudaError_t Generate(const GenerateView& view, generate::Format format, uint64_t first,
                     uint64_t count, void* out, cudaStream_t stream) {
  if (count == 0) return cudaSuccess;
  switch (format.output) {
    case Output::kI32x3:
      return Launch<Output::kI32x3>(view, format.sampling, first, count, out, stream);
    case Output::kF32x3:
      return Launch<Output::kF32x3>(view, format.sampling, first, count, out, stream);
    case Output::kI16x3:
      return Launch<Output::kI16x3>(view, format.sampling, first, count, out, stream);
    case Output::kPacked:
      return Launch<Output::kPacked>(view, format.sampling, first, count, out, stream);
  }
  return cudaErrorInvalidValue;
}

}  // namespace voxeld::gpu::cuda
