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
using Rules = generate::WalkRules<kGenerateRun>;

constexpr int kThreads = 32 * kGenerateWarps;

__global__ void PrepareRecords(GenerateView view) {
  const uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= view.count) return;
  const FixedSegment g = view.segments[i];
  const int64_t n = static_cast<int64_t>(view.offsets[i + 1] - view.offsets[i]) - 1;
  const int64_t grain = generate::GrainOf(g);
  SegmentRecord record;
  record.steps = static_cast<uint32_t>(n);
  record.sure = 1;
  for (int a = 0; a < 3; ++a) {
    const Stride stride = Stride::Of(g.s[a], g.e[a], n);
    StepRecord& axis = record.axis[a];
    axis.step_fraction = stride.step_fraction;
    axis.whole = static_cast<uint32_t>(stride.whole);
    axis.step_whole = static_cast<uint32_t>(stride.step_whole);
    axis.fraction = static_cast<uint32_t>(stride.fraction >> 32);
    axis.bias = Rules::BiasOf(stride, n, grain);
    // Values that are no nearer below a whole number than the zone and all rounding.
    record.sure &= Rules::Apart(n, grain);
  }
  view.records[i] = record;
}

// The segment that holds a voxel, between lo and hi.
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

__device__ Walk WalkFrom(const StepRecord& axis, uint32_t k) {
  Stride stride;
  stride.fraction = static_cast<uint64_t>(axis.fraction) << 32;
  stride.step_fraction = axis.step_fraction;
  stride.whole = static_cast<int32_t>(axis.whole);
  stride.step_whole = static_cast<int32_t>(axis.step_whole);
  return Rules::From(stride, k, axis.bias);
}

__device__ __noinline__ Voxel ExactVoxel(const GenerateView& view, uint32_t segment, uint32_t k) {
  const FixedSegment g = view.segments[segment];
  const int64_t n = view.records[segment].steps;
  int32_t v[3];
  for (int a = 0; a < 3; ++a)
    v[a] = CoordinateAt(Stride::Of(g.s[a], g.e[a], n), g.s[a], g.e[a], n, k);
  return {v[0], v[1], v[2]};
}

struct Walks {
  Walk axis[3];

  __device__ void Begin(const SegmentRecord& record, uint32_t k) {
    for (int a = 0; a < 3; ++a) axis[a] = WalkFrom(record.axis[a], k);
  }
  __device__ void Next() {
    for (int a = 0; a < 3; ++a) axis[a].at += axis[a].step;
  }
  __device__ Voxel voxel() const { return {axis[0].whole(), axis[1].whole(), axis[2].whole()}; }
  __device__ uint32_t least() const {
    return min(min(axis[0].fraction(), axis[1].fraction()), axis[2].fraction());
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

// A warp's voxels, four a thread, to memory in whole lines: through shared memory, where they are laid out
// as they will be.
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

// `warp_at`: of the warp's first voxel, from `out` on; `end`: of the first that is not asked for.
template <Output kOut>
__device__ void Store(const Voxel (&v)[kGenerateRun], uint64_t warp_at, uint32_t lane_at,
                      uint64_t end, uint4* stage, void* out) {
  if (warp_at + kGenerateRound <= end) return StoreWarp<kOut>(v, warp_at, stage, out);
  for (uint32_t i = 0; i < kGenerateRun; ++i) {
    if (warp_at + lane_at + i < end) StoreOne<kOut>(v[i], warp_at + lane_at + i, out);
  }
}

// Voxels of one segment from step k on.
__device__ void MakeRun(const GenerateView& view, const SegmentRecord& record, uint32_t segment,
                        uint32_t k, Voxel (&v)[kGenerateRun]) {
  Walks walks;
  walks.Begin(record, k);
  uint32_t least = 0xFFFFFFFF;
#pragma unroll
  for (uint32_t i = 0; i < kGenerateRun; ++i) {
    v[i] = walks.voxel();
    if (!record.sure) least = min(least, walks.least());
    walks.Next();
  }
  if (!record.sure && Rules::Doubtful(least)) {
    for (uint32_t i = 0; i < kGenerateRun; ++i) {
      if (k + i <= record.steps) v[i] = ExactVoxel(view, segment, k + i);
    }
  }
}

// The same across the ends of segments.
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
    if (Rules::Doubtful(walks.least())) v[i] = ExactVoxel(view, segment, k);
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

// Where a warp is: the segment of its next voxel, and where the one after that ends.
struct Place {
  uint32_t segment;
  uint64_t begin, end, next_end;
  SegmentRecord record;

  __device__ void Load(const GenerateView& view, uint32_t to) {
    segment = to;
    begin = view.offsets[to];
    end = view.offsets[to + 1];
    record = view.records[to];
    LookAhead(view);
  }
  // To the next segment, whose record is known.
  __device__ void Advance(const GenerateView& view, const SegmentRecord& next) {
    ++segment;
    begin = end;
    end = next_end;
    record = next;
    LookAhead(view);
  }
  __device__ void LookAhead(const GenerateView& view) {
    const uint32_t next = min(segment + 1, view.count - 1);
    next_end = view.offsets[next + 1];
    const auto* at = reinterpret_cast<const char*>(&view.records[next]);
    asm volatile("prefetch.global.L1 [%0];" ::"l"(at));
    asm volatile("prefetch.global.L1 [%0];" ::"l"(at + sizeof(SegmentRecord) - 1));
  }
};

// A round in which one segment ends and the next one does not.
__device__ void MakeTwoRuns(const GenerateView& view, const SegmentRecord& record,
                            const SegmentRecord& next, const Place& place, uint64_t voxel,
                            Voxel (&v)[kGenerateRun]) {
  if (voxel < place.end) {
    MakeRun(view, record, place.segment, static_cast<uint32_t>(voxel - place.begin), v);
    if (voxel + kGenerateRun <= place.end) return;
  }
  Voxel w[kGenerateRun];
  // Before its first voxel the walk goes backwards, to where nobody looks.
  MakeRun(view, next, place.segment + 1, static_cast<uint32_t>(voxel - place.end), w);
#pragma unroll
  for (uint32_t i = 0; i < kGenerateRun; ++i) {
    if (voxel + i >= place.end) v[i] = w[i];
  }
}

// Each warp makes a run of voxels of its own, a round of kGenerateRound at a time. `first` and `end` count from
// the batch's first voxel.
template <Output kOut, bool kCover>
__global__ void __launch_bounds__(kThreads)
    GenerateVoxels(const __grid_constant__ GenerateView view, uint64_t first, uint64_t end,
                   void* out) {
  __shared__ uint4 stages[kGenerateWarps][kGenerateRound * 12 / 16];
  uint4* const stage = stages[threadIdx.x / 32];
  const uint32_t warp_voxels = view.rounds * kGenerateRound;
  const uint64_t warp =
      first / warp_voxels + static_cast<uint64_t>(blockIdx.x) * kGenerateWarps + threadIdx.x / 32;
  uint64_t warp_at = warp * warp_voxels;
  if (warp_at >= end) return;
  const uint32_t lane_at = threadIdx.x % 32 * kGenerateRun;
  const uint32_t last = view.first_segments[warp + 1];
  Place place;
  place.Load(view, view.first_segments[warp]);
  Voxel v[kGenerateRun];
  for (uint32_t round = 0;;) {
    const uint64_t voxel = warp_at + lane_at, next_at = warp_at + kGenerateRound;
    bool known = false;  // where the next round begins
    if constexpr (kCover) {
      if (voxel < view.voxels) MakeCoverRun(view, place.segment, last, voxel, v);
    } else if (next_at <= place.end) {
      MakeRun(view, place.record, place.segment, static_cast<uint32_t>(voxel - place.begin), v);
      known = next_at < place.end;
    } else if (next_at <= place.next_end) {
      const SegmentRecord next = view.records[place.segment + 1];
      MakeTwoRuns(view, place.record, next, place, voxel, v);
      place.Advance(view, next);
      known = next_at < place.end;
    } else if (voxel < view.voxels) {
      MakeMixedRun(view, place.segment, last, voxel, v);
    }
    Store<kOut>(v, warp_at - first, lane_at, end - first, stage, out);
    warp_at = next_at;
    if (++round == view.rounds || warp_at >= end) return;
    if (!known && warp_at >= place.end)
      place.Load(view, SegmentOf(view.offsets, place.segment + 1, last, warp_at));
  }
}

template <Output kOut>
cudaError_t Launch(const GenerateView& view, Sampling sampling, uint64_t first, uint64_t count,
                   void* out, cudaStream_t stream) {
  const uint64_t each = view.warp_voxels() * kGenerateWarps;
  const auto blocks = static_cast<uint32_t>((count + each - 1) / each);
  if (sampling == Sampling::kCover) {
    GenerateVoxels<kOut, true><<<blocks, kThreads, 0, stream>>>(view, first, first + count, out);
  } else {
    GenerateVoxels<kOut, false><<<blocks, kThreads, 0, stream>>>(view, first, first + count, out);
  }
  return cudaGetLastError();
}

}  // namespace

cudaError_t PrepareGenerate(const GenerateView& view, cudaStream_t stream) {
  PrepareRecords<<<(view.count + 127) / 128, 128, 0, stream>>>(view);
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
