#include "gpu/slice/column_kernel.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "gpu/word.h"

// Look-ups among 256 bytes justify a target of their own.
#define HWY_WANT_AVX3_DL
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gpu/slice/column_kernel.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

#include "gpu/slice/column_kernel-inl.h"

#if HWY_ONCE
namespace voxeld::gpu {
namespace {

HWY_EXPORT(LevelChunksIn);
HWY_EXPORT(DrawRgb332In);
HWY_EXPORT(ColumnTargetIn);

}  // namespace

void LevelChunks(const LevelTables& tables, std::span<const ChunkToLevel> chunks) {
  HWY_DYNAMIC_DISPATCH(LevelChunksIn)(tables, chunks);
}

void DrawRgb332(std::span<const uint8_t* const> levels, size_t columns, size_t chunks,
                const uint64_t (&dither)[8], uint8_t* out) {
  HWY_DYNAMIC_DISPATCH(DrawRgb332In)(levels, columns, chunks, dither, out);
}

std::string ColumnTarget() { return HWY_DYNAMIC_DISPATCH(ColumnTargetIn)(); }

}  // namespace voxeld::gpu
#endif
