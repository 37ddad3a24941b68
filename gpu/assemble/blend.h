// How layers combine into what is shown. Host and device.
#pragma once

#include "gpu/records.h"
#include "gpu/word.h"

namespace voxeld::gpu {

// s(c) = (c·o + 127) / 255, for a channel.
VOXELD_HD inline uint32_t Scale(uint32_t c, uint32_t opacity) { return (c * opacity + 127) / 255; }

VOXELD_HD inline uint32_t BlendChannel(uint32_t below, uint32_t c, BlendMode mode,
                                       uint32_t opacity) {
  switch (mode) {
    case BlendMode::kOver:
      return Scale(c, opacity);
    case BlendMode::kAdd: {
      const uint32_t sum = below + Scale(c, opacity);
      return sum < 255 ? sum : 255;
    }
    case BlendMode::kErase:
      return Scale(below, 255 - opacity);
  }
  return below;
}

// The colour of a voxel after a layer whose word there is `word`; colours are interleaved (word.h).
VOXELD_HD inline uint32_t BlendLayer(uint32_t below, uint32_t word, BlendMode mode,
                                     uint32_t opacity) {
  if (!IsCovered(word)) return below;
  if (mode == BlendMode::kOver && opacity == 255) return word & kColorMask;
  const uint32_t b = Deinterleave(below), c = Deinterleave(word & kColorMask);
  uint32_t rgb = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    rgb |= BlendChannel((b >> shift) & 0xFF, (c >> shift) & 0xFF, mode, opacity) << shift;
  }
  return Interleave(rgb);
}

}  // namespace voxeld::gpu
