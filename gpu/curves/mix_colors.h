// Mixes two colours. Host only.
#pragma once

#include <cmath>
#include <cstdint>

namespace voxeld::gpu::curves {

// Returns 0xRRGGBB between a (t = 0) and b (t = 1), each channel rounded to the nearest level.
inline uint32_t MixColors(uint32_t a, uint32_t b, double t) {
  uint32_t rgb = 0;
  for (int shift = 16; shift >= 0; shift -= 8) {
    const double from = (a >> shift) & 255, to = (b >> shift) & 255;
    rgb = rgb << 8 | static_cast<uint32_t>(std::lround(from + (to - from) * t));
  }
  return rgb;
}

}  // namespace voxeld::gpu::curves
