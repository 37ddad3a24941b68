// The entry points that cpu_kernel.cc calls, compiled once for each instruction set.
#if defined(VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_
#undef VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_
#else
#define VOXELD_GPU_GENERATE_CPU_KERNEL_INL_H_
#endif

#include "gpu/generate/cpu_blocks-inl.h"

HWY_BEFORE_NAMESPACE();
namespace voxeld::gpu::generate {
namespace HWY_NAMESPACE {

HWY_ATTR inline void CountVoxelsIn(const Batch& batch, Sampling sampling, size_t begin, size_t end,
                                   uint64_t* counts, UnitBounds& bounds) {
  batch.With([&](const auto& segments) {
    for (; begin < end && bounds.all_within; begin += kBlock) {
      bounds.all_within =
          CountBlock(segments, sampling, begin, std::min(begin + kBlock, end), counts, bounds);
    }
  });
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

HWY_ATTR inline void EmitVoxelsIn(const Batch& batch, Format format,
                                  std::span<const uint64_t> offsets, uint64_t first, uint64_t count,
                                  bool past_caches, std::byte* out) {
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

HWY_ATTR inline void StreamingFillIn(std::span<std::byte> out, uint32_t word) {
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

inline const char* TargetIn() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace voxeld::gpu::generate
HWY_AFTER_NAMESPACE();

#endif
