// Segments as walks in vectors (stride.h), one segment at a time. Part of cpu_kernel.cc, compiled
// for each instruction set.
#if defined(VOXELD_GPU_GENERATE_CPU_WALKS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_GENERATE_CPU_WALKS_INL_H_
#undef VOXELD_GPU_GENERATE_CPU_WALKS_INL_H_
#else
#define VOXELD_GPU_GENERATE_CPU_WALKS_INL_H_
#endif

#include "gpu/generate/cpu_stage-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu::generate {
namespace HWY_NAMESPACE {

// A walk in each lane, each a step beyond the one before it.
struct LaneWalks {
  VU whole, fraction, step_whole, step_fraction;

  // `all`: the combined step of as many steps as there are lanes.
  HWY_ATTR HWY_INLINE void Begin(const Walk& walk, uint64_t all) {
    const DU d;
#if HWY_TARGET == HWY_SCALAR
    fraction = hn::Set(d, static_cast<uint32_t>(walk.at));
    whole = hn::Set(d, static_cast<uint32_t>(walk.at >> 32));
#else
    const hn::Repartition<uint64_t, DU> d64;
    const hn::Repartition<uint32_t, decltype(d64)> d32;
    const size_t half = hn::Lanes(d64);
    const auto step_low = hn::BitCast(d32, hn::Set(d64, walk.step & 0xFFFFFFFF));
    const auto step_high = hn::BitCast(d32, hn::Set(d64, walk.step >> 32));
    const auto base = hn::Set(d64, walk.at);
    hn::Vec<decltype(d64)> parts[2];
    for (size_t i = 0; i < 2; ++i) {
      const auto lane = hn::BitCast(d32, hn::Iota(d64, i * half));
      parts[i] = hn::Add(base, hn::Add(hn::MulEven(step_low, lane),
                                       hn::ShiftLeft<32>(hn::MulEven(step_high, lane))));
    }
    const VU low = hn::BitCast(d, parts[0]), high = hn::BitCast(d, parts[1]);
    fraction = hn::ConcatEven(d, high, low);
    whole = hn::ConcatOdd(d, high, low);
#endif
    step_whole = hn::Set(d, static_cast<uint32_t>(all >> 32));
    step_fraction = hn::Set(d, static_cast<uint32_t>(all));
  }
  HWY_ATTR HWY_INLINE void Next() {
    const DU d;
    fraction = hn::Add(fraction, step_fraction);
    const auto carry = hn::VecFromMask(d, hn::Lt(fraction, step_fraction));  // all ones: −1
    whole = hn::Sub(hn::Add(whole, step_whole), carry);
  }
};

// Computes voxels for which the vectors are doubtful, one by one.
template <Output kOut, class Exact>
HWY_NOINLINE void StoreExact(uint32_t k, uint32_t count, std::byte* at, const Exact& exact) {
  for (uint32_t i = 0; i < count; ++i) StoreVoxel<kOut>(exact(k + i), at + i * BytesOf(kOut));
}

// Emits `count` voxels from the beginnings of three walks. `exact(k)` returns the voxel if the
// walks are doubtful. kStream: writes directly to `to`, which begins a line; `count` is a multiple
// of kLanes.
template <Output kOut, bool kStream, class Exact>
HWY_ATTR HWY_INLINE void EmitWalks(const Spread& spread, const Walk (&walks)[3],
                                   const uint64_t (&all)[3], uint32_t k, uint32_t count,
                                   Stage& stage, std::byte* to, const Exact& exact) {
  const DU d;
  const VU zone = hn::Set(d, Rules::kWalkZone);
  LaneWalks p[3];
  if constexpr (kOut == Output::kPacked) {
    for (size_t a = 0; a < 3; ++a) p[a].Begin(walks[a], all[a]);
  } else {
    // Store lane by lane: this takes little time compared with a walk.
    HWY_ALIGN uint32_t whole[3 * kLanes], fraction[3 * kLanes];
    for (size_t a = 0; a < 3; ++a) {
      uint64_t at = walks[a].at;
      for (size_t i = 0; i < kLanes; ++i, at += walks[a].step) {
        whole[3 * i + a] = static_cast<uint32_t>(at >> 32);
        fraction[3 * i + a] = static_cast<uint32_t>(at);
      }
    }
    for (size_t v = 0; v < 3; ++v) {
      p[v].whole = hn::Load(d, whole + v * kLanes);
      p[v].fraction = hn::Load(d, fraction + v * kLanes);
      p[v].step_whole = spread.Of(v, hn::Set(d, static_cast<uint32_t>(all[0] >> 32)),
                                  hn::Set(d, static_cast<uint32_t>(all[1] >> 32)),
                                  hn::Set(d, static_cast<uint32_t>(all[2] >> 32)));
      p[v].step_fraction = spread.Of(v, hn::Set(d, static_cast<uint32_t>(all[0])),
                                     hn::Set(d, static_cast<uint32_t>(all[1])),
                                     hn::Set(d, static_cast<uint32_t>(all[2])));
    }
  }
  for (;;) {
    const uint32_t here = kStream || count >= kLanes ? static_cast<uint32_t>(kLanes) : count;
    const auto least = hn::Min(hn::Min(p[0].fraction, p[1].fraction), p[2].fraction);
    const bool doubt = HWY_UNLIKELY(!hn::AllFalse(d, hn::Lt(least, zone)));
    if constexpr (kStream) {
      if (HWY_UNLIKELY(doubt)) {
        StoreExact<kOut>(k, here, to, exact);
      } else if constexpr (kOut == Output::kPacked) {
        StorePacked<true>(p[0].whole, p[1].whole, p[2].whole, to);
      } else {
        StoreSpread<kOut, true>(p[0].whole, p[1].whole, p[2].whole, to);
      }
      to += kLanes * BytesOf(kOut);
    } else {
      std::byte* const at = stage.next();
      if constexpr (kOut == Output::kPacked) {
        StorePacked(p[0].whole, p[1].whole, p[2].whole, at);
      } else {
        StoreSpread<kOut>(p[0].whole, p[1].whole, p[2].whole, at);
      }
      if (HWY_UNLIKELY(doubt)) StoreExact<kOut>(k, here, at, exact);
      stage.Add(here * BytesOf(kOut));
    }
    count -= here;
    if (count == 0) return;
    k += here;
    for (size_t v = 0; v < 3; ++v) p[v].Next();
  }
}

// Emits voxels k to k + count − 1 of a segment of n > 0 steps.
template <Output kOut>
HWY_ATTR void EmitLong(const Spread& spread, const FixedSegment& g, int64_t n, uint32_t k,
                       uint64_t count, Stage& stage) {
  constexpr auto lanes = static_cast<uint32_t>(kLanes);
  const int64_t grain = GrainOf(g);
  Stride strides[3];
  uint32_t bias[3];
  uint64_t all[3];
  for (int a = 0; a < 3; ++a) {
    strides[a] = Stride::Of(g.s[a], g.e[a], n);
    bias[a] = Rules::BiasOf(strides[a], n, grain);
    all[a] = Rules::StepOfMany(strides[a], lanes);
  }
  const auto exact = [&](uint32_t at) {
    return Voxel{CoordinateAt(strides[0], g.s[0], g.e[0], n, at),
                 CoordinateAt(strides[1], g.s[1], g.e[1], n, at),
                 CoordinateAt(strides[2], g.s[2], g.e[2], n, at)};
  };
  const auto emit = [&]<bool kStream>(uint64_t run, std::byte* to) {
    Walk walks[3];
    for (int a = 0; a < 3; ++a) walks[a] = Rules::From(strides[a], k, bias[a]);
    EmitWalks<kOut, kStream>(spread, walks, all, k, static_cast<uint32_t>(run), stage, to, exact);
    k += static_cast<uint32_t>(run);
  };
  constexpr uint64_t kRun = uint64_t{lanes} * kVectorSteps;
  if constexpr (kOut != Output::kI16x3) {
    const std::optional<size_t> to_line = stage.ToLine(BytesOf(kOut));
    if (to_line.has_value() && count >= kDirect) {
      const uint64_t head = *to_line / BytesOf(kOut);
      if (head > 0) emit.template operator()<false>(head, nullptr);
      std::byte* const begin = stage.Drain();
      uint64_t left = (count - head) / lanes * lanes;
      count -= head + left;
      std::byte* to = begin;
      while (left > 0) {
        const uint64_t run = std::min(left, kRun);
        emit.template operator()<true>(run, to);
        to += run * BytesOf(kOut);
        left -= run;
      }
      stage.Skip(static_cast<size_t>(to - begin));
    }
  }
  while (count > 0) {
    const uint64_t run = std::min(count, kRun);
    emit.template operator()<false>(run, nullptr);
    count -= run;
  }
}

// The same for few steps: 32 bits hold a voxel's offset from the segment's first one, with a
// fraction of 22 bits. Rounding and zones are those of a walk (stride.h), in units of 2⁻²².
template <Output kOut>
HWY_ATTR HWY_INLINE void EmitShort(const Spread& spread, const FixedSegment& g, int64_t n,
                                   uint32_t k, uint32_t count, Stage& stage) {
  constexpr int kBits = 22;
  static_assert((kShortSteps + 2) << kBits < int64_t{1} << 31);
  const DU d;
  const hn::RebindToSigned<DU> di;
  const auto steps = static_cast<int32_t>(n);
  const uint32_t too_large = static_cast<uint32_t>(steps) + 1, zone = 2 * too_large;
  const bool apart = static_cast<uint64_t>(n) * (zone + too_large) <
                     (static_cast<uint64_t>(GrainOf(g)) << (kBits - kFractionBits));
  uint32_t cell[3], begin[3], step[3];
  for (int a = 0; a < 3; ++a) {
    const auto length = static_cast<int32_t>(g.e[a] - g.s[a]) * (1 << (kBits - kFractionBits));
    const int32_t of_one = steps == 0 ? 0 : CeilDiv<int32_t>(length, steps);
    const uint32_t bias = apart || steps == 0 || of_one * steps == length ? zone : zone - too_large;
    cell[a] = static_cast<uint32_t>(CellOf(g.s[a]));
    begin[a] = (static_cast<uint32_t>(g.s[a] & (kUnits - 1)) << (kBits - kFractionBits)) + bias +
               static_cast<uint32_t>(of_one) * k;
    step[a] = static_cast<uint32_t>(of_one);
  }
  const auto exact = [&](uint32_t at) {
    int32_t v[3];
    for (int a = 0; a < 3; ++a) {
      v[a] = n == 0 ? static_cast<int32_t>(cell[a]) : ExactCoordinate(g.s[a], g.e[a], n, at);
    }
    return Voxel{v[0], v[1], v[2]};
  };
  const VU zones = hn::Set(d, zone), fraction = hn::Set(d, (1u << kBits) - 1);
  const VU xs = hn::Set(d, step[0]), ys = hn::Set(d, step[1]), zs = hn::Set(d, step[2]);
  const VU xb = hn::Set(d, begin[0]), yb = hn::Set(d, begin[1]), zb = hn::Set(d, begin[2]);
  const VU xc = hn::Set(d, cell[0]), yc = hn::Set(d, cell[1]), zc = hn::Set(d, cell[2]);
  VU at[3], advance[3], cells[3];
  if constexpr (kOut == Output::kPacked) {
    const VU lane = hn::Iota(d, 0);
    at[0] = hn::Add(xb, hn::Mul(xs, lane)), at[1] = hn::Add(yb, hn::Mul(ys, lane)),
    at[2] = hn::Add(zb, hn::Mul(zs, lane));
    advance[0] = hn::Mul(xs, hn::Set(d, kLanes)), advance[1] = hn::Mul(ys, hn::Set(d, kLanes));
    advance[2] = hn::Mul(zs, hn::Set(d, kLanes));
    cells[0] = xc, cells[1] = yc, cells[2] = zc;
  } else {
    for (size_t v = 0; v < 3; ++v) {
      const VU one = spread.Of(v, xs, ys, zs);
      at[v] = hn::Add(spread.Of(v, xb, yb, zb), hn::Mul(one, spread.voxel[v]));
      advance[v] = hn::Mul(one, hn::Set(d, kLanes));
      cells[v] = spread.Of(v, xc, yc, zc);
    }
  }
  for (;;) {
    std::byte* const to = stage.next();
    VU whole[3];
    for (size_t v = 0; v < 3; ++v) {
      whole[v] = hn::Add(cells[v], hn::BitCast(d, hn::ShiftRight<kBits>(hn::BitCast(di, at[v]))));
    }
    if constexpr (kOut == Output::kPacked) {
      StorePacked(whole[0], whole[1], whole[2], to);
    } else {
      StoreSpread<kOut>(whole[0], whole[1], whole[2], to);
    }
    const uint32_t here = count < kLanes ? count : static_cast<uint32_t>(kLanes);
    const auto least = hn::Min(hn::Min(hn::And(at[0], fraction), hn::And(at[1], fraction)),
                               hn::And(at[2], fraction));
    if (HWY_UNLIKELY(!hn::AllFalse(d, hn::Lt(least, zones)))) StoreExact<kOut>(k, here, to, exact);
    stage.Add(here * BytesOf(kOut));
    count -= here;
    if (count == 0) return;
    k += here;
    for (size_t v = 0; v < 3; ++v) at[v] = hn::Add(at[v], advance[v]);
  }
}

template <Output kOut>
HWY_ATTR void EmitCover(const FixedSegment& g, int64_t k, uint64_t count, Stage& stage) {
  const Cover cover = Cover::Of(g);
  int64_t taken[3];
  cover.Find(k, taken);
  for (; count > 0; --count) {
    StoreVoxel<kOut>(cover.CellAfter(taken), stage.next());
    stage.Add(BytesOf(kOut));
    cover.Step(taken);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu::generate
HWY_AFTER_NAMESPACE();

#endif
