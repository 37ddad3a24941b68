// Finds which colours of a row are not black.
#pragma once

#include <cstdint>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "gpu/primitives/grid.h"

namespace voxeld::gpu {

// Returns bits: bit i is 1 if the i-th of `count` colours (at most kTileSize), each 2^shift words
// after the last, is not black.
inline uint32_t LitBits(const uint32_t* from, int32_t count, uint32_t shift) {
#ifdef __SSE2__
  static_assert(kTileSize == 16, "as many as a mask has bits");
  if (shift == 0 && count == kTileSize) {  // the usual case
    const auto black = [&](int32_t i) {
      return _mm_cmpeq_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i)),
                             _mm_setzero_si128());
    };
    const __m128i words =
        _mm_packs_epi16(_mm_packs_epi32(black(0), black(4)), _mm_packs_epi32(black(8), black(12)));
    return static_cast<uint32_t>(_mm_movemask_epi8(words)) ^ 0xFFFF;
  }
#endif
  uint32_t bits = 0;
  for (int32_t i = 0; i < count; ++i) {
    bits |= static_cast<uint32_t>(from[static_cast<uint32_t>(i) << shift] != 0) << i;
  }
  return bits;
}

}  // namespace voxeld::gpu
