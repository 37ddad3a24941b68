#include "gpu/texture_levels.h"

#include <algorithm>
#include <cstddef>

#include "gpu/primitives/texture.h"

namespace voxeld::gpu {
namespace {

// The mean of red and blue, or of green, of four colours at once: sums of four fit in 10 bits, and
// each channel has room for them.
uint32_t MeanOf(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  constexpr uint32_t kOuter = 0x00FF00FF, kInner = 0x0000FF00;
  const uint32_t outer = (a & kOuter) + (b & kOuter) + (c & kOuter) + (d & kOuter) + 0x00020002;
  const uint32_t inner = (a & kInner) + (b & kInner) + (c & kInner) + (d & kInner) + 0x00000200;
  return (outer >> 2 & kOuter) | (inner >> 2 & kInner);
}

}  // namespace

void FillLevels(uint32_t width, uint32_t height, std::span<uint32_t> texels) {
  size_t from = 0;
  while (width > 1 || height > 1) {
    const uint32_t next_width = HalfSide(width), next_height = HalfSide(height);
    const size_t to = from + size_t{width} * height;
    for (uint32_t y = 0; y < next_height; ++y) {
      const size_t upper = from + size_t{2 * y} * width;
      const size_t lower = height > 1 ? upper + width : upper;
      for (uint32_t x = 0; x < next_width; ++x) {
        const size_t left = size_t{2} * x, right = std::min(left + 1, size_t{width} - 1);
        texels[to + size_t{y} * next_width + x] =
            MeanOf(texels[upper + left], texels[upper + right], texels[lower + left],
                   texels[lower + right]);
      }
    }
    from = to;
    width = next_width;
    height = next_height;
  }
}

}  // namespace voxeld::gpu
