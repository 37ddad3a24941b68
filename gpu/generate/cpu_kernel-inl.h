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

constexpr int kVectorSteps = 1024;  // from one exact beginning
constexpr size_t kMostLanes = HWY_MAX_BYTES / 4;
constexpr int64_t kShortSteps = 192;
constexpr uint64_t kDirect = 256;  // voxels that are worth a line's beginning
using Rules = WalkRules<kVectorSteps + 64>;
static_assert(HWY_MAX_BYTES > 256 || kMostLanes <= 64, "a walk begins at each lane");

// Voxels on their way to memory: made in the cache, written in whole lines.
class Stage {
 public:
  static constexpr size_t kBytes = 16 << 10;

  Stage(std::byte* out, uint64_t bytes, bool past_caches) : out_(out), stream_(past_caches) {
    // Lines begin where the output's do.
    used_ = begin_ = stream_ ? reinterpret_cast<uintptr_t>(out) % kLine : 0;
    // Where the caches keep it, what follows in the output itself may be written over while there is some.
    if (!stream_ && bytes > kSlack) direct_until_ = out + (bytes - kSlack);
  }
  ~Stage() {
    std::memcpy(out_, buffer_ + begin_, used_ - begin_);
    if (stream_) hwy::FlushStream();
  }
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  // Bytes, a multiple of `each`, after which the output is at the beginning of a line; none: it never is, or
  // stores do not go past the caches.
  std::optional<size_t> ToLine(size_t each) const {
    const size_t over = (reinterpret_cast<uintptr_t>(out_) + used_ - begin_) % kLine;
    if (!stream_ || over % 4 != 0) return std::nullopt;
    size_t bytes = 0;
    while ((over + bytes) % kLine != 0) bytes += each;
    return bytes;
  }
  // Writes all that is held. What follows may be written to where it says, as far as Skip is then told.
  std::byte* Drain() {
    std::memcpy(out_, buffer_ + begin_, used_ - begin_);
    out_ += used_ - begin_;
    used_ = begin_ = reinterpret_cast<uintptr_t>(out_) % kLine;
    return out_;
  }
  void Skip(size_t bytes) {
    out_ += bytes;
    used_ = begin_ = reinterpret_cast<uintptr_t>(out_) % kLine;
  }

  // Where the next voxels go: a vector of them, or kShortSteps + 1 and one.
  std::byte* next() { return out_ < direct_until_ ? out_ : buffer_ + used_; }
  HWY_ATTR void Add(size_t bytes) {
    if (out_ < direct_until_) {
      out_ += bytes;
      return;
    }
    used_ += bytes;
    if (used_ >= kBytes) Flush();
  }

 private:
  static constexpr size_t kLine = 64;
  static constexpr size_t kSlack = 12 * (kShortSteps + 1 + kMostLanes);

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
      for (size_t i = at; i < whole; i += hn::Lanes(d))
        hn::Stream(hn::Load(d, from + i), d, to + (i - at));
    } else {
      std::memcpy(out_, buffer_ + at, whole - at);
    }
    out_ += whole - at;
    std::memcpy(buffer_, buffer_ + whole, used_ - whole);
    used_ -= whole;
  }

  alignas(HWY_MAX_BYTES < 64 ? 64 : HWY_MAX_BYTES) std::byte buffer_[kBytes + kSlack + kLine];
  std::byte* out_;
  std::byte* direct_until_ = nullptr;
  size_t used_ = 0, begin_ = 0;
  const bool stream_;
};

// Three vectors hold as many voxels as one has lanes, laid out as they go to memory: lane l of vector v is
// axis (L·v + l) mod 3 of voxel ⌊(L·v + l)/3⌋. What is kept of each axis is spread over them once.
constexpr size_t kLanes = hn::MaxLanes(DU());
constexpr int kLaneBits = std::countr_zero(kLanes);

struct Spread {
  hn::Mask<DU> y[3], z[3];
  VU voxel[3];
  VU bytes[3];  // for TableLookupBytes, of x, y, z in each 16 bytes

  HWY_ATTR Spread() {
    const DU d;
    for (size_t v = 0; v < 3; ++v) {
      HWY_ALIGN uint32_t axes[kLanes], voxels[kLanes];
      for (size_t l = 0; l < kLanes; ++l) {
        axes[l] = static_cast<uint32_t>((kLanes * v + l) % 3);
        voxels[l] = static_cast<uint32_t>((kLanes * v + l) / 3);
      }
      y[v] = hn::Eq(hn::Load(d, axes), hn::Set(d, 1));
      z[v] = hn::Eq(hn::Load(d, axes), hn::Set(d, 2));
      voxel[v] = hn::Load(d, voxels);
      bytes[v] =
          hn::Add(hn::Mul(hn::Load(d, axes), hn::Set(d, 0x04040404)), hn::Set(d, 0x03020100));
    }
  }
  HWY_ATTR HWY_INLINE VU Of(size_t v, VU x_, VU y_, VU z_) const {
    return hn::IfThenElse(y[v], y_, hn::IfThenElse(z[v], z_, x_));
  }
};

template <bool kStream, class D, class V>
HWY_ATTR HWY_INLINE void StoreLanes(V v, D d, hn::TFromD<D>* at) {
  if constexpr (kStream) {
    hn::Stream(v, d, at);
  } else {
    hn::StoreU(v, d, at);
  }
}

template <Output kOut, bool kStream = false>
HWY_ATTR HWY_INLINE void StoreSpread(VU a, VU b, VU c, std::byte* at) {
  const hn::RebindToSigned<DU> di;
  const VU all[3] = {a, b, c};
  for (size_t v = 0; v < 3; ++v) {
    const auto whole = hn::BitCast(di, all[v]);
    if constexpr (kOut == Output::kI32x3) {
      StoreLanes<kStream>(whole, di, reinterpret_cast<int32_t*>(at) + v * kLanes);
    } else if constexpr (kOut == Output::kF32x3) {
      const hn::RebindToFloat<DU> df;
      StoreLanes<kStream>(hn::ConvertTo(df, whole), df, reinterpret_cast<float*>(at) + v * kLanes);
    } else {
      const hn::Rebind<int16_t, decltype(di)> ds;
      hn::StoreU(hn::DemoteTo(ds, whole), ds, reinterpret_cast<int16_t*>(at) + v * kLanes);
    }
  }
}

template <bool kStream = false>
HWY_ATTR HWY_INLINE void StorePacked(VU x, VU y, VU z, std::byte* at) {
  StoreLanes<kStream>(hn::Or(x, hn::Or(hn::ShiftLeft<11>(y), hn::ShiftLeft<22>(z))), DU(),
                      reinterpret_cast<uint32_t*>(at));
}

template <Output kOut>
HWY_INLINE void StoreVoxel(const Voxel& v, std::byte* at) {
  if constexpr (kOut == Output::kI32x3) {
    std::memcpy(at, &v, 12);
  } else if constexpr (kOut == Output::kF32x3) {
    const float f[3] = {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
    std::memcpy(at, f, 12);
  } else if constexpr (kOut == Output::kI16x3) {
    const int16_t s[3] = {static_cast<int16_t>(v.x), static_cast<int16_t>(v.y),
                          static_cast<int16_t>(v.z)};
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

// Voxels on which the vectors leave a doubt, one by one.
template <Output kOut, class Exact>
HWY_NOINLINE void StoreExact(uint32_t k, uint32_t count, std::byte* at, const Exact& exact) {
  for (uint32_t i = 0; i < count; ++i) StoreVoxel<kOut>(exact(k + i), at + i * BytesOf(kOut));
}

// `count` voxels from three walks' beginnings. `exact(k)` gives the voxel where the walks leave a doubt.
// kStream: straight to `to`, which begins a line; `count` is a multiple of kLanes.
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
    // Lane by lane: a walk is long.
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

// Voxels k to k + count − 1 of a segment of n > 0 steps.
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
  const auto emit = [&]<bool kStream>(uint32_t run, std::byte* to) {
    Walk walks[3];
    for (int a = 0; a < 3; ++a) walks[a] = Rules::From(strides[a], k, bias[a]);
    EmitWalks<kOut, kStream>(spread, walks, all, k, run, stage, to, exact);
    k += run;
    count -= run;
  };
  constexpr uint32_t kRun = lanes * kVectorSteps;
  if constexpr (kOut != Output::kI16x3) {
    const std::optional<size_t> to_line = stage.ToLine(BytesOf(kOut));
    if (to_line.has_value() && count >= kDirect) {
      if (*to_line > 0)
        emit.template operator()<false>(static_cast<uint32_t>(*to_line / BytesOf(kOut)), nullptr);
      std::byte* to = stage.Drain();
      std::byte* const begin = to;
      while (count >= lanes) {
        const auto run = static_cast<uint32_t>(std::min<uint64_t>(count / lanes * lanes, kRun));
        emit.template operator()<true>(run, to);
        to += run * BytesOf(kOut);
      }
      stage.Skip(static_cast<size_t>(to - begin));
    }
  }
  while (count > 0) {
    emit.template operator()<false>(static_cast<uint32_t>(std::min<uint64_t>(count, kRun)),
                                    nullptr);
  }
}

// The same for few steps: 32 bits hold where a voxel lies from the segment's first one, with 22 of
// fraction. Rounding and zones are those of a walk (stride.h), in units of 2⁻²².
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

using DF = hn::ScalableTag<double>;
using VF = hn::Vec<DF>;
constexpr size_t kBlock = 64;  // segments whose arithmetic is done together

// Coordinates as they lie in memory, `count` of them (room for a vector more), in units; exact.
template <typename T>
HWY_ATTR HWY_INLINE VF LoadUnits(const T* from) {
  const DF d;
  const hn::Rebind<T, DF> dt;
  if constexpr (std::is_same_v<T, double>) {
    return hn::Floor(hn::Add(hn::Mul(hn::LoadU(d, from), hn::Set(d, 65536.0)), hn::Set(d, 0.5)));
  } else if constexpr (std::is_same_v<T, float>) {
    const VF v = hn::PromoteTo(d, hn::LoadU(dt, from));
    return hn::Floor(hn::Add(hn::Mul(v, hn::Set(d, 65536.0)), hn::Set(d, 0.5)));
  } else {
    return hn::Mul(hn::PromoteTo(d, hn::LoadU(dt, from)), hn::Set(d, 65536.0));
  }
}

// Sixes of start and end, in units, and what they have in common.
struct UnitBlock {
  HWY_ALIGN double q[6 * kBlock + 64];
  bool whole;   // all are whole voxels
  bool within;  // all are coordinates
  double lo[3], hi[3];

  template <typename T>
  HWY_ATTR void Load(std::span<const Segment<T>> segments, size_t begin, size_t end) {
    static_assert(sizeof(Segment<T>) == 6 * sizeof(T));
    constexpr double kMost = static_cast<double>(kMostCoordinate * kUnits);
    constexpr double kFar = std::numeric_limits<double>::infinity();
    const DF d;
    const T* from = segments[begin].start.data();
    const size_t values = 6 * (end - begin), lanes = hn::Lanes(d);
    const VF far = hn::Set(d, kFar), most = hn::Set(d, kMost), voxel = hn::Set(d, 1.0 / 65536);
    // Lane l of vector i is axis (lanes·i + l) mod 3: three vectors later it is so again.
    VF least[3] = {far, far, far}, greatest[3] = {hn::Neg(far), hn::Neg(far), hn::Neg(far)};
    auto all_whole = hn::Eq(far, far), all_within = all_whole;
    const auto take = [&](VF units, size_t i, size_t phase) HWY_ATTR {
      hn::Store(units, d, q + i);
      const VF voxels = hn::Mul(units, voxel);
      all_whole = hn::And(all_whole, hn::Eq(voxels, hn::Floor(voxels)));
      all_within =
          hn::And(all_within, hn::Le(hn::Abs(units), most));  // false for what is no number
      least[phase] = hn::Min(least[phase], units);
      greatest[phase] = hn::Max(greatest[phase], units);
    };
    size_t i = 0;
    for (; i + 3 * lanes <= values; i += 3 * lanes) {
      for (size_t v = 0; v < 3; ++v) take(LoadUnits(from + i + v * lanes), i + v * lanes, v);
    }
    HWY_ALIGN double edge[2][3 * HWY_MAX_BYTES / sizeof(double)];
    for (size_t v = 0; v < 3; ++v) {
      hn::Store(least[v], d, edge[0] + v * lanes);
      hn::Store(greatest[v], d, edge[1] + v * lanes);
    }
    whole = hn::AllTrue(d, all_whole);
    within = hn::AllTrue(d, all_within);
    for (size_t a = 0; a < 3; ++a) {
      lo[a] = kFar, hi[a] = -kFar;
      for (size_t l = a; l < 3 * lanes; l += 3)
        lo[a] = std::min(lo[a], edge[0][l]), hi[a] = std::max(hi[a], edge[1][l]);
    }
    // Nothing beyond the last one is loaded.
    for (; i < values; ++i) {
      q[i] = std::floor(static_cast<double>(from[i]) * 65536.0 + 0.5);
      whole &= q[i] * (1.0 / 65536) == std::floor(q[i] * (1.0 / 65536));
      within &= q[i] >= -kMost && q[i] <= kMost;
      lo[i % 3] = std::min(lo[i % 3], q[i]);
      hi[i % 3] = std::max(hi[i % 3], q[i]);
    }
  }
};

HWY_INLINE double CellsBetween(double a, double b) {
  constexpr double kVoxel = 1.0 / static_cast<double>(kUnits);
  return std::abs(std::floor(b * kVoxel) - std::floor(a * kVoxel));
}

template <typename T>
HWY_ATTR bool CountBlock(std::span<const Segment<T>> segments, Sampling sampling, size_t begin,
                         size_t end, uint64_t* counts, UnitBounds& bounds) {
  UnitBlock block;
  block.Load(segments, begin, end);
  if (!block.within) return false;
  for (size_t a = 0; a < 3; ++a) {
    bounds.lo[a] = std::min(bounds.lo[a], block.lo[a]);
    bounds.hi[a] = std::max(bounds.hi[a], block.hi[a]);
  }
  for (size_t i = begin; i < end; ++i) {
    const double* const q = block.q + 6 * (i - begin);
    if (sampling == Sampling::kEuclidean) {
      // A sum of squares below 2⁵² is exact, and its root is rounded correctly.
      constexpr double kExact = static_cast<double>(int64_t{1} << 52);
      const double x = q[3] - q[0], y = q[4] - q[1], z = q[5] - q[2];
      const double square = x * x + y * y + z * z;
      const auto n = static_cast<int64_t>(std::sqrt(square) * (1.0 / static_cast<double>(kUnits)));
      counts[i] = square >= kExact || n == 0 ? 0 : static_cast<uint64_t>(n) + 1;
      continue;
    }
    const double x = CellsBetween(q[0], q[3]), y = CellsBetween(q[1], q[4]),
                 z = CellsBetween(q[2], q[5]);
    counts[i] = static_cast<uint64_t>(sampling == Sampling::kThin ? std::max(x, std::max(y, z))
                                                                  : x + y + z) +
                1;
  }
  return true;
}

HWY_ATTR void CountVoxelsIn(const Batch& batch, Sampling sampling, size_t begin, size_t end,
                            uint64_t* counts, UnitBounds& bounds) {
  batch.With([&](const auto& segments) {
    for (; begin < end && bounds.all_within; begin += kBlock) {
      bounds.all_within =
          CountBlock(segments, sampling, begin, std::min(begin + kBlock, end), counts, bounds);
    }
  });
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

// The same for whole segments of few steps, whose arithmetic is done together: what EmitShort works out of
// each, in three of four places.
struct ShortBlock {
  HWY_ALIGN int32_t cell[4 * kBlock + 16], begin[4 * kBlock + 16], step[4 * kBlock + 16];

  // `zone`, `too_large`: of the block's longest; `apart`: so are all.
  HWY_ATTR void Set(const UnitBlock& block, const uint64_t* offsets, size_t count, uint32_t zone,
                    uint32_t too_large, bool apart) {
    const hn::CappedTag<double, 4> d;
    const hn::Rebind<int32_t, decltype(d)> di;
    const auto whole_bias = hn::Set(d, static_cast<double>(zone));
    const auto bias = hn::Set(d, static_cast<double>(apart ? zone : zone - too_large));
    for (size_t i = 0; i < count; ++i) {
      const auto n =
          hn::Set(d, static_cast<double>(std::max<uint64_t>(1, offsets[i + 1] - offsets[i] - 1)));
      for (size_t a = 0; a < 3; a += hn::Lanes(d)) {
        const auto s = hn::LoadU(d, block.q + 6 * i + a), e = hn::LoadU(d, block.q + 6 * i + 3 + a);
        const auto cells = hn::Floor(hn::Mul(s, hn::Set(d, 1.0 / 65536)));
        const auto fraction = hn::Sub(s, hn::Mul(cells, hn::Set(d, 65536.0)));
        // A quotient of so small numbers is rounded to a whole one only if it is one.
        const auto quotient = hn::Div(hn::Mul(hn::Sub(e, s), hn::Set(d, 64.0)), n);
        const auto one = hn::Ceil(quotient);
        const auto from = hn::Add(hn::Mul(fraction, hn::Set(d, 64.0)),
                                  hn::IfThenElse(hn::Eq(one, quotient), whole_bias, bias));
        hn::StoreU(hn::DemoteTo(di, cells), di, cell + 4 * i + a);
        hn::StoreU(hn::DemoteTo(di, from), di, begin + 4 * i + a);
        hn::StoreU(hn::DemoteTo(di, one), di, step + 4 * i + a);
      }
    }
  }
};

template <Output kOut>
HWY_ATTR void EmitShortBlock(const Spread& spread, const UnitBlock& units, const uint64_t* offsets,
                             size_t count, uint32_t longest, Stage& stage) {
  constexpr int kBits = 22;
  const DU d;
  const hn::RebindToSigned<DU> di;
  const uint32_t too_large = longest + 1, zone = 2 * too_large;
  const uint64_t grain =
      units.whole ? uint64_t{1} << kBits : uint64_t{1} << (kBits - kFractionBits);
  ShortBlock block;
  block.Set(units, offsets, count, zone, too_large, uint64_t{longest} * (zone + too_large) < grain);
  const VU zones = hn::Set(d, zone), fraction = hn::Set(d, (1u << kBits) - 1);
  const auto spread_of = [&](const int32_t* from, size_t v) HWY_ATTR {
    const auto all = hn::LoadDup128(di, from);
    return hn::BitCast(d, hn::TableLookupBytes(all, hn::BitCast(di, spread.bytes[v])));
  };
  for (size_t i = 0; i < count; ++i) {
    const auto n = static_cast<int64_t>(offsets[i + 1] - offsets[i]) - 1;
    VU at[3], advance[3], cells[3];
    for (size_t v = 0; v < 3; ++v) {
      const VU one = spread_of(block.step + 4 * i, v);
      at[v] = hn::Add(spread_of(block.begin + 4 * i, v), hn::Mul(one, spread.voxel[v]));
      advance[v] = hn::ShiftLeft<kLaneBits>(one);
      cells[v] = spread_of(block.cell + 4 * i, v);
    }
    const double* const q = units.q + 6 * i;
    const auto exact = [&](uint32_t k) {
      int32_t c[3];
      for (int a = 0; a < 3; ++a) {
        const auto s = static_cast<int64_t>(q[a]), e = static_cast<int64_t>(q[3 + a]);
        c[a] = static_cast<int32_t>(n == 0 ? CellOf(s)
                                           : FloorDiv<int64_t>(s * n + (e - s) * k, n * kUnits));
      }
      return Voxel{c[0], c[1], c[2]};
    };
    std::byte* const first = stage.next();
    std::byte* to = first;
    VU least = fraction;
    for (auto left = static_cast<int32_t>(n + 1);; left -= static_cast<int32_t>(kLanes)) {
      VU whole[3];
      for (size_t v = 0; v < 3; ++v) {
        whole[v] = hn::Add(cells[v], hn::BitCast(d, hn::ShiftRight<kBits>(hn::BitCast(di, at[v]))));
        least = hn::Min(least, hn::And(at[v], fraction));
      }
      StoreSpread<kOut>(whole[0], whole[1], whole[2], to);
      to += kLanes * BytesOf(kOut);
      if (left <= static_cast<int32_t>(kLanes)) break;
      for (size_t v = 0; v < 3; ++v) at[v] = hn::Add(at[v], advance[v]);
    }
    if (HWY_UNLIKELY(!hn::AllFalse(d, hn::Lt(least, zones)))) {
      StoreExact<kOut>(0, static_cast<uint32_t>(n + 1), first, exact);
    }
    stage.Add(static_cast<size_t>(n + 1) * BytesOf(kOut));
  }
}

// How many of the segments from `i` on, all of whose voxels are wanted, are short; and their longest.
inline size_t ShortFrom(std::span<const uint64_t> offsets, size_t i, uint64_t end,
                        uint32_t* longest) {
  size_t count = 0;
  *longest = 0;
  while (count < kBlock && i + count + 1 < offsets.size() && offsets[i + count + 1] <= end) {
    const uint64_t steps = offsets[i + count + 1] - offsets[i + count] - 1;
    if (steps > static_cast<uint64_t>(kShortSteps)) break;
    *longest = std::max(*longest, static_cast<uint32_t>(steps));
    ++count;
  }
  return count;
}

template <Output kOut, typename T>
HWY_ATTR void EmitRange(std::span<const Segment<T>> segments, Sampling sampling,
                        std::span<const uint64_t> offsets, uint64_t first, uint64_t count,
                        bool past_caches, std::byte* out) {
  const Spread spread;
  Stage stage(out, count * BytesOf(kOut), past_caches);
  size_t i = static_cast<size_t>(std::upper_bound(offsets.begin(), offsets.end(), first) -
                                 offsets.begin()) -
             1;
  UnitBlock units;
  while (count > 0) {
    if constexpr (kLanes >= 4 && kOut != Output::kPacked) {
      uint32_t longest = 0;
      const size_t block = sampling == Sampling::kCover || first != offsets[i]
                               ? 0
                               : ShortFrom(offsets, i, first + count, &longest);
      if (block >= 4) {
        units.Load(segments, i, i + block);
        EmitShortBlock<kOut>(spread, units, offsets.data() + i, block, longest, stage);
        count -= offsets[i + block] - first;
        first = offsets[i + block];
        i += block;
        continue;
      }
    }
    const FixedSegment g = ToFixed(segments[i]);
    const auto n = static_cast<int64_t>(offsets[i + 1] - offsets[i]) - 1;
    const uint64_t k = first - offsets[i];
    const uint64_t here = std::min(count, static_cast<uint64_t>(n) + 1 - k);
    if (sampling == Sampling::kCover) {
      EmitCover<kOut>(g, static_cast<int64_t>(k), here, stage);
    } else if (n <= kShortSteps) {
      EmitShort<kOut>(spread, g, n, static_cast<uint32_t>(k), static_cast<uint32_t>(here), stage);
    } else {
      EmitLong<kOut>(spread, g, n, static_cast<uint32_t>(k), here, stage);
    }
    first += here;
    count -= here;
    ++i;
  }
}

HWY_ATTR void EmitVoxelsIn(const Batch& batch, Format format, std::span<const uint64_t> offsets,
                           uint64_t first, uint64_t count, bool past_caches, std::byte* out) {
  batch.With([&](const auto& segments) {
    switch (format.output) {
      case Output::kI32x3:
        return EmitRange<Output::kI32x3>(segments, format.sampling, offsets, first, count,
                                         past_caches, out);
      case Output::kF32x3:
        return EmitRange<Output::kF32x3>(segments, format.sampling, offsets, first, count,
                                         past_caches, out);
      case Output::kI16x3:
        return EmitRange<Output::kI16x3>(segments, format.sampling, offsets, first, count,
                                         past_caches, out);
      case Output::kPacked:
        return EmitRange<Output::kPacked>(segments, format.sampling, offsets, first, count,
                                          past_caches, out);
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
