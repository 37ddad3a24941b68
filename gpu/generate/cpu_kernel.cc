#include "gpu/generate/cpu_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>

#include "gpu/generate/cover.h"
#include "gpu/generate/stride.h"

// Vectors are members of structs, so their size must be known at compile time.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gpu/generate/cpu_kernel.cc"
#include "hwy/cache_control.h"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

#include "gpu/generate/cpu_kernel-inl.h"

#if HWY_ONCE
namespace voxeld::gpu::generate {
namespace {

HWY_EXPORT(EmitVoxelsIn);
HWY_EXPORT(CountVoxelsIn);
HWY_EXPORT(StreamingFillIn);
HWY_EXPORT(TargetIn);

}  // namespace

void EmitVoxels(const Batch& batch, Format format, std::span<const uint64_t> offsets,
                uint64_t first, uint64_t count, bool past_caches, std::byte* out) {
  if (count > 0) HWY_DYNAMIC_DISPATCH(EmitVoxelsIn)
  (batch, format, offsets, first, count, past_caches, out);
}

void CountVoxels(const Batch& batch, Sampling sampling, size_t begin, size_t end, uint64_t* counts,
                 UnitBounds& bounds) {
  HWY_DYNAMIC_DISPATCH(CountVoxelsIn)(batch, sampling, begin, end, counts, bounds);
}

void StreamingFill(std::span<std::byte> out, uint32_t word) {
  HWY_DYNAMIC_DISPATCH(StreamingFillIn)(out, word);
}

std::string VectorTarget() { return HWY_DYNAMIC_DISPATCH(TargetIn)(); }

}  // namespace voxeld::gpu::generate
#endif
