// Converts linear light to a display's levels, with dither. Host and device.
#pragma once

#include <cstdint>

#include "display/api/frame_layout.h"
#include "gpu/portable.h"

namespace voxeld::gpu {

// Blue noise: the ranks of a square of pixels, each number from 0 to kNoiseRanks − 1 once
// (blue_noise.h).
inline constexpr uint32_t kNoiseSide = 64, kNoiseRanks = kNoiseSide * kNoiseSide;
// The shift of ranks from slice to slice: the golden section of all ranks, so that a column of
// pixels through the slices also has evenly spread thresholds. Odd.
inline constexpr uint32_t kNoiseTurn = 2531;

// The 8×8 Bayer matrix, 0 to 63: column u, row v; the lowest bits of u and v weigh most.
VOXELD_HD inline uint32_t Bayer8(uint32_t u, uint32_t v) {
  uint32_t b = 0;
  for (int bit = 0; bit < 3; ++bit) {
    b = b << 2 | (((u ^ v) >> bit) & 1u) << 1 | ((v >> bit) & 1u);
  }
  return b;
}

// Returns the number that is added before rounding down: 0 to 65534. Over sub-frames the matrix'
// values rotate, so that each pixel runs through evenly spread thresholds. For kNone and kOrdered.
VOXELD_HD inline uint32_t Threshold(display::Dither dither, uint32_t u, uint32_t v, uint32_t sub,
                                    uint32_t sub_frames) {
  if (dither == display::Dither::kNone) return 32767;
  const uint32_t b = (Bayer8(u, v) + sub * 64 / sub_frames) % 64;
  return (2 * b + 1) * 65535 / 128;
}

// The same for kBlueNoise, from a pixel's rank. 7 to 65527.
VOXELD_HD inline uint32_t NoiseThreshold(uint32_t rank, uint32_t slice, uint32_t sub,
                                         uint32_t sub_frames) {
  const uint32_t b = (rank + slice * kNoiseTurn + sub * kNoiseRanks / sub_frames) % kNoiseRanks;
  return (2 * b + 1) * 65535 / (2 * kNoiseRanks);
}

// Converts light of 0 to 65535 to a level of 0 to levels − 1. Full light always gives the highest
// level, no light the lowest.
VOXELD_HD inline uint32_t Quantize(uint32_t light, uint32_t levels, uint32_t threshold) {
  return (light * (levels - 1) + threshold) / 65535;
}

}  // namespace voxeld::gpu
