// How the CPU writes voxels: staged in the cache, past the caches, and their layout in vectors.
// Part of cpu_kernel.cc, compiled for each instruction set.
#if defined(VOXELD_GPU_GENERATE_CPU_STAGE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_GENERATE_CPU_STAGE_INL_H_
#undef VOXELD_GPU_GENERATE_CPU_STAGE_INL_H_
#else
#define VOXELD_GPU_GENERATE_CPU_STAGE_INL_H_
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
constexpr uint64_t kDirect = 256;  // the number of voxels that justifies aligning to a line
using Rules = WalkRules<kVectorSteps + 64>;
static_assert(HWY_MAX_BYTES > 256 || kMostLanes <= 64, "a walk begins at each lane");

// Voxels on their way to memory: they are staged in the cache and written in whole lines.
class Stage {
 public:
  static constexpr size_t kBytes = 16 << 10;

  Stage(std::byte* out, uint64_t bytes, bool past_caches) : out_(out), stream_(past_caches) {
    // Lines of the buffer begin where those of the output do.
    used_ = begin_ = stream_ ? reinterpret_cast<uintptr_t>(out) % kLine : 0;
    // If the caches keep the output, voxels are written to it directly, and the bytes after them
    // may be overwritten while enough are left.
    if (!stream_ && bytes > kSlack) direct_until_ = out + (bytes - kSlack);
  }
  ~Stage() {
    std::memcpy(out_, buffer_ + begin_, used_ - begin_);
    if (stream_) hwy::FlushStream();
  }
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

  // Returns the number of bytes, a multiple of `each`, after which the output is at the beginning
  // of a line; nullopt if it never is, or if stores do not go past the caches.
  std::optional<size_t> ToLine(size_t each) const {
    const size_t over = (reinterpret_cast<uintptr_t>(out_) + used_ - begin_) % kLine;
    if (!stream_ || over % 4 != 0) return std::nullopt;
    size_t bytes = 0;
    while ((over + bytes) % kLine != 0) bytes += each;
    return bytes;
  }
  // Writes everything that is held. The caller may write further bytes at the returned address, and
  // then reports their number with Skip.
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

  // Returns where the next voxels go: a vector of them, or kShortSteps + 1 and one vector.
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

// Three vectors hold as many voxels as one vector has lanes, in their layout in memory: lane l of
// vector v is axis (L·v + l) mod 3 of voxel ⌊(L·v + l)/3⌋. Values of each axis are spread over them
// once.
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

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu::generate
HWY_AFTER_NAMESPACE();

#endif
