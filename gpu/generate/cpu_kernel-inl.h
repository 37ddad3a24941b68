// One instruction set's share of cpu_kernel.cc, included once for each.
#if defined(VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_
#undef VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_
#else
#define VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_
#endif

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu::generate {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using DU = hn::ScalableTag<uint32_t>;
using VU = hn::Vec<DU>;

constexpr uint64_t kPastCaches = uint64_t{4} << 20;  // bytes from which stores go past the caches
constexpr int kVectorSteps = 256;                    // from one exact beginning
constexpr size_t kMostLanes = HWY_MAX_BYTES / 4;
constexpr int64_t kShortSteps = 192;
using Rules = WalkRules<kVectorSteps + 64>;
static_assert(HWY_MAX_BYTES > 256 || kMostLanes <= 64, "a walk begins at each lane");

// Voxels on their way to memory: made in the cache, written in whole lines.
class Stage {
 public:
  static constexpr size_t kBytes = 16 << 10;

  Stage(std::byte* out, uint64_t bytes) : out_(out), stream_(bytes >= kPastCaches) {
    // Lines begin where the output's do.
    used_ = begin_ = stream_ ? reinterpret_cast<uintptr_t>(out) % kLine : 0;
  }
  ~Stage() {
    std::memcpy(out_, buffer_ + begin_, used_ - begin_);
    if (stream_) hwy::FlushStream();
  }
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  // Where the next voxels go, a vector of them at least.
  std::byte* next() { return buffer_ + used_; }
  HWY_ATTR void Add(size_t bytes) {
    used_ += bytes;
    if (used_ >= kBytes) Flush();
  }

 private:
  static constexpr size_t kLine = 64;

  HWY_ATTR void Flush() {
    size_t at = begin_;
    if (begin_ > 0) {
      std::memcpy(out_, buffer_ + begin_, kLine - begin_);
      out_ += kLine - begin_;
      at = kLine;
      begin_ = 0;
    }
    const size_t whole = used_ / kLine * kLine;
    if (stream_) {
      const hn::ScalableTag<uint8_t> d;
      const auto* from = reinterpret_cast<const uint8_t*>(buffer_);
      auto* to = reinterpret_cast<uint8_t*>(out_);
      for (size_t i = at; i < whole; i += hn::Lanes(d)) hn::Stream(hn::Load(d, from + i), d, to + (i - at));
    } else {
      std::memcpy(out_, buffer_ + at, whole - at);
    }
    out_ += whole - at;
    std::memcpy(buffer_, buffer_ + whole, used_ - whole);
    used_ -= whole;
  }

  alignas(HWY_MAX_BYTES < 64 ? 64 : HWY_MAX_BYTES) std::byte buffer_[kBytes + 12 * kMostLanes + kLine];
  std::byte* out_;
  size_t used_ = 0, begin_ = 0;
  const bool stream_;
};

template <Output kOut>
HWY_ATTR HWY_INLINE void StoreVoxels(VU x, VU y, VU z, std::byte* at) {
  const hn::RebindToSigned<DU> di;
  if constexpr (kOut == Output::kI32x3) {
    hn::StoreInterleaved3(x, y, z, DU(), reinterpret_cast<uint32_t*>(at));
  } else if constexpr (kOut == Output::kF32x3) {
    const hn::RebindToFloat<DU> df;
    hn::StoreInterleaved3(hn::ConvertTo(df, hn::BitCast(di, x)), hn::ConvertTo(df, hn::BitCast(di, y)),
                          hn::ConvertTo(df, hn::BitCast(di, z)), df, reinterpret_cast<float*>(at));
  } else if constexpr (kOut == Output::kI16x3) {
    const hn::Rebind<int16_t, decltype(di)> ds;
    hn::StoreInterleaved3(hn::DemoteTo(ds, hn::BitCast(di, x)), hn::DemoteTo(ds, hn::BitCast(di, y)),
                          hn::DemoteTo(ds, hn::BitCast(di, z)), ds, reinterpret_cast<int16_t*>(at));
  } else {
    hn::StoreU(hn::Or(x, hn::Or(hn::ShiftLeft<11>(y), hn::ShiftLeft<22>(z))), DU(),
               reinterpret_cast<uint32_t*>(at));
  }
}

template <Output kOut>
HWY_INLINE void StoreVoxel(const Voxel& v, std::byte* at) {
  if constexpr (kOut == Output::kI32x3) {
    std::memcpy(at, &v, 12);
  } else if constexpr (kOut == Output::kF32x3) {
    const float f[3] = {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
    std::memcpy(at, f, 12);
  } else if constexpr (kOut == Output::kI16x3) {
    const int16_t s[3] = {static_cast<int16_t>(v.x), static_cast<int16_t>(v.y), static_cast<int16_t>(v.z)};
    std::memcpy(at, s, 6);
  } else {
    const uint32_t p = static_cast<uint32_t>(v.x) | static_cast<uint32_t>(v.y) << 11 |
                       static_cast<uint32_t>(v.z) << 22;
    std::memcpy(at, &p, 4);
  }
}

// A walk in each lane, each a step beyond the one before it.
struct LaneWalks {
  VU whole, fraction, step_whole, step_fraction;

  // `all`: the step of as many steps as there are lanes.
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

// The step of `times` steps, rounded up to 32 fraction bits.
HWY_INLINE uint64_t StepOfMany(const Stride& stride, uint32_t times) {
  const unsigned __int128 fraction = static_cast<unsigned __int128>(stride.step_fraction) * times;
  const auto whole = static_cast<uint32_t>(stride.step_whole) * times + static_cast<uint32_t>(fraction >> 64);
  const auto rest = static_cast<uint64_t>(fraction);
  return (static_cast<uint64_t>(whole) << 32) + (rest >> 32) + (static_cast<uint32_t>(rest) != 0);
}

// `count` voxels from three walks' beginnings. `exact(k)` gives the voxel where the walks leave a doubt.
template <Output kOut, class Exact>
HWY_ATTR HWY_INLINE void EmitWalks(const Walk (&walks)[3], const uint64_t (&all)[3], uint32_t k,
                                   uint32_t count, Stage& stage, const Exact& exact) {
  const DU d;
  const auto lanes = static_cast<uint32_t>(hn::Lanes(d));
  const VU zone = hn::Set(d, Rules::kWalkZone);
  LaneWalks x, y, z;
  x.Begin(walks[0], all[0]);
  y.Begin(walks[1], all[1]);
  z.Begin(walks[2], all[2]);
  for (;;) {
    std::byte* const at = stage.next();
    StoreVoxels<kOut>(x.whole, y.whole, z.whole, at);
    const uint32_t here = count < lanes ? count : lanes;
    const auto least = hn::Min(hn::Min(x.fraction, y.fraction), z.fraction);
    if (HWY_UNLIKELY(!hn::AllFalse(d, hn::Lt(least, zone)))) {
      for (uint32_t i = 0; i < here; ++i) StoreVoxel<kOut>(exact(k + i), at + i * BytesOf(kOut));
    }
    stage.Add(here * BytesOf(kOut));
    count -= here;
    if (count == 0) return;
    k += here;
    x.Next();
    y.Next();
    z.Next();
  }
}

// Voxels k to k + count − 1 of a segment of n > 0 steps.
template <Output kOut>
HWY_ATTR void EmitLong(const FixedSegment& g, int64_t n, uint32_t k, uint64_t count, Stage& stage) {
  const auto lanes = static_cast<uint32_t>(hn::Lanes(DU()));
  const int64_t grain = GrainOf(g);
  Stride strides[3];
  uint32_t bias[3];
  uint64_t all[3];
  for (int a = 0; a < 3; ++a) {
    strides[a] = Stride::Of(g.s[a], g.e[a], n);
    bias[a] = Rules::BiasOf(strides[a], n, grain);
    all[a] = StepOfMany(strides[a], lanes);
  }
  const auto exact = [&](uint32_t at) {
    return Voxel{CoordinateAt(strides[0], g.s[0], g.e[0], n, at), CoordinateAt(strides[1], g.s[1], g.e[1], n, at),
                 CoordinateAt(strides[2], g.s[2], g.e[2], n, at)};
  };
  while (count > 0) {
    const auto run = static_cast<uint32_t>(std::min<uint64_t>(count, uint64_t{lanes} * kVectorSteps));
    Walk walks[3];
    for (int a = 0; a < 3; ++a) walks[a] = Rules::From(strides[a], k, bias[a]);
    EmitWalks<kOut>(walks, all, k, run, stage, exact);
    k += run;
    count -= run;
  }
}

// The same for few steps: one walk from S on, whose roundings add up to less than the zone allows.
template <Output kOut>
HWY_ATTR HWY_INLINE void EmitShort(const FixedSegment& g, int64_t n, uint32_t k, uint32_t count,
                                   Stage& stage) {
  const auto lanes = static_cast<uint32_t>(hn::Lanes(DU()));
  const bool apart = Rules::Apart(n, GrainOf(g));
  Walk walks[3];
  uint64_t all[3];
  for (int a = 0; a < 3; ++a) {
    const int64_t length = (g.e[a] - g.s[a]) * kUnits;
    const int64_t step = n == 0 ? 0 : CeilDiv<int64_t>(length, n);
    const uint32_t bias =
        apart || step * n == length ? Rules::kWalkZone : Rules::kWalkZone - Rules::kTooLarge;
    walks[a].step = static_cast<uint64_t>(step);
    walks[a].at = (static_cast<uint64_t>(g.s[a]) << (32 - kFractionBits)) + bias + walks[a].step * k;
    all[a] = walks[a].step * lanes;
  }
  const auto exact = [&](uint32_t at) {
    if (n == 0) {
      return Voxel{static_cast<int32_t>(CellOf(g.s[0])), static_cast<int32_t>(CellOf(g.s[1])),
                   static_cast<int32_t>(CellOf(g.s[2]))};
    }
    return Voxel{ExactCoordinate(g.s[0], g.e[0], n, at), ExactCoordinate(g.s[1], g.e[1], n, at),
                 ExactCoordinate(g.s[2], g.e[2], n, at)};
  };
  EmitWalks<kOut>(walks, all, k, count, stage, exact);
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

template <Output kOut, typename T>
HWY_ATTR void EmitRange(std::span<const Segment<T>> segments, Sampling sampling,
                        std::span<const uint64_t> offsets, uint64_t first, uint64_t count,
                        std::byte* out) {
  Stage stage(out, count * BytesOf(kOut));
  size_t i = static_cast<size_t>(std::upper_bound(offsets.begin(), offsets.end(), first) - offsets.begin()) - 1;
  for (; count > 0; ++i) {
    const FixedSegment g = ToFixed(segments[i]);
    const auto n = static_cast<int64_t>(offsets[i + 1] - offsets[i]) - 1;
    const uint64_t k = first - offsets[i];
    const uint64_t here = std::min(count, static_cast<uint64_t>(n) + 1 - k);
    if (sampling == Sampling::kCover) {
      EmitCover<kOut>(g, static_cast<int64_t>(k), here, stage);
    } else if (n <= kShortSteps) {
      EmitShort<kOut>(g, n, static_cast<uint32_t>(k), static_cast<uint32_t>(here), stage);
    } else {
      EmitLong<kOut>(g, n, static_cast<uint32_t>(k), here, stage);
    }
    first += here;
    count -= here;
  }
}

HWY_ATTR void EmitVoxelsIn(const Batch& batch, Format format, std::span<const uint64_t> offsets,
                           uint64_t first, uint64_t count, std::byte* out) {
  batch.With([&](const auto& segments) {
    switch (format.output) {
      case Output::kI32x3:
        return EmitRange<Output::kI32x3>(segments, format.sampling, offsets, first, count, out);
      case Output::kF32x3:
        return EmitRange<Output::kF32x3>(segments, format.sampling, offsets, first, count, out);
      case Output::kI16x3:
        return EmitRange<Output::kI16x3>(segments, format.sampling, offsets, first, count, out);
      case Output::kPacked:
        return EmitRange<Output::kPacked>(segments, format.sampling, offsets, first, count, out);
    }
  });
}

HWY_ATTR void StreamingFillIn(std::span<std::byte> out, uint32_t word) {
  const DU d;
  auto* at = reinterpret_cast<uint32_t*>(out.data());
  const size_t words = out.size() / 4, lanes = hn::Lanes(d);
  const VU value = hn::Set(d, word);
  size_t i = 0;
  for (; i < words && reinterpret_cast<uintptr_t>(at + i) % (lanes * 4) != 0; ++i) at[i] = word;
  for (; i + lanes <= words; i += lanes) hn::Stream(value, d, at + i);
  for (; i < words; ++i) at[i] = word;
  hwy::FlushStream();
}

const char* TargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu::generate
HWY_AFTER_NAMESPACE();

#endif
