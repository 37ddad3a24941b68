#include "gpu/assemble/span_kernel.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "gpu/word.h"

// Vectors whose size is known when this is compiled.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gpu/assemble/span_kernel.cc"
#include "hwy/cache_control.h"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

#include "gpu/assemble/span_kernel-inl.h"

#if HWY_ONCE
namespace voxeld::gpu {
namespace {

HWY_EXPORT(FindSpansIn);
HWY_EXPORT(DrawSpansIn);
HWY_EXPORT(ShowWordsIn);
HWY_EXPORT(LitColorsIn);
HWY_EXPORT(MoveColorsIn);
HWY_EXPORT(MoveWordsIn);
HWY_EXPORT(SpanTargetIn);

}  // namespace

void FindSpans(const LineWalk* walks, uint32_t first, uint32_t last, const WalkGrid& grid,
               const uint8_t* owned, FoundSpans& found) {
  HWY_DYNAMIC_DISPATCH(FindSpansIn)(walks, first, last, grid, owned, found);
}

void DrawSpans(const LineWalk* walks, std::span<const BinItem> items, uint32_t* words,
               TileRows& touched) {
  HWY_DYNAMIC_DISPATCH(DrawSpansIn)(walks, items, words, touched);
}

uint32_t ShowWords(uint32_t* words, const TileRows& touched, TileRows& rows) {
  return HWY_DYNAMIC_DISPATCH(ShowWordsIn)(words, touched, rows);
}

uint32_t LitColors(const uint32_t* colors, TileRows& rows) {
  return HWY_DYNAMIC_DISPATCH(LitColorsIn)(colors, rows);
}

bool MoveColors(uint32_t* colors, const TileRows& rows, bool past_caches, uint32_t* held,
                const TileRows& held_rows) {
  return HWY_DYNAMIC_DISPATCH(MoveColorsIn)(colors, rows, past_caches, held, held_rows);
}

MovedWords MoveWords(uint32_t* words, const TileRows& touched, bool past_caches, uint32_t* held,
                     TileRows& held_rows) {
  return HWY_DYNAMIC_DISPATCH(MoveWordsIn)(words, touched, past_caches, held, held_rows);
}

void FinishMoves() { hwy::FlushStream(); }

std::string SpanTarget() { return HWY_DYNAMIC_DISPATCH(SpanTargetIn)(); }

}  // namespace voxeld::gpu
#endif
