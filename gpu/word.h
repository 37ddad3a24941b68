// The voxel word: the value that blending within a layer compares, and the format in which colours
// are stored.
//
//   bits 31–25  priority + 1 (1 to 127; word 0 means uncovered, so black covers)
//   bit  24     erase: at one priority an erase wins; its colour is 0
//   bits 23–0   colour, the bits of green, red and blue interleaved from the top: G7 R7 B7 G6 …
//
// A layer's voxel is the maximum of all words that cover it, so neither order nor repetition
// matters.
#pragma once

#include <cstdint>

#include "gpu/portable.h"

namespace voxeld::gpu {

inline constexpr uint32_t kEraseBit = 1u << 24;
inline constexpr uint32_t kColorMask = kEraseBit - 1;

// Spreads the bits of an 8-bit value to every third position.
VOXELD_HD inline uint32_t Spread3(uint32_t v) {
  v = (v | (v << 8)) & 0x00F00Fu;
  v = (v | (v << 4)) & 0x0C30C3u;
  v = (v | (v << 2)) & 0x249249u;
  return v;
}

VOXELD_HD inline uint32_t Gather3(uint32_t v) {
  v &= 0x249249u;
  v = (v | (v >> 2)) & 0x0C30C3u;
  v = (v | (v >> 4)) & 0x00F00Fu;
  v = (v | (v >> 8)) & 0x0000FFu;
  return v;
}

// Converts 0x00RRGGBB to interleaved bits and back.
VOXELD_HD inline uint32_t Interleave(uint32_t rgb) {
  return Spread3((rgb >> 8) & 0xFF) << 2 | Spread3((rgb >> 16) & 0xFF) << 1 | Spread3(rgb & 0xFF);
}

VOXELD_HD inline uint32_t Deinterleave(uint32_t w) {
  return Gather3(w >> 1) << 16 | Gather3(w >> 2) << 8 | Gather3(w);
}

// Multiplies each channel by the tint's, where 255 is 1, and rounds.
VOXELD_HD inline uint32_t Tinted(uint32_t rgb, uint32_t tint) {
  if (tint == 0x00FFFFFF) return rgb & 0x00FFFFFF;
  uint32_t tinted = 0;
  for (uint32_t shift = 0; shift < 24; shift += 8) {
    tinted |= (((rgb >> shift) & 255) * ((tint >> shift) & 255) + 127) / 255 << shift;
  }
  return tinted;
}

// Requires: `priority` is 0 to 126; `rgb` is 0x00RRGGBB.
VOXELD_HD inline uint32_t MakeWord(uint32_t priority, bool erase, uint32_t rgb) {
  return (priority + 1) << 25 | (erase ? kEraseBit : Interleave(rgb));
}

// Returns whether the word covers its voxel in its layer: it is neither 0 nor an erase.
VOXELD_HD inline bool IsCovered(uint32_t word) { return word != 0 && (word & kEraseBit) == 0; }

}  // namespace voxeld::gpu
