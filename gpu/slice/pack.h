// Where a pixel's levels go in a picture's bytes. Host and device.
#pragma once

#include <cstddef>
#include <cstdint>

#include "display/api/slice_frame.h"
#include "gpu/portable.h"
#include "gpu/slice/quantize.h"

namespace voxeld::gpu {

// Levels of red, green and blue.
struct Levels {
  uint32_t r, g, b;
};

VOXELD_HD constexpr Levels LevelsOf(display::PixelFormat format) {
  switch (format) {
    case display::PixelFormat::kRgb888:
      return {256, 256, 256};
    case display::PixelFormat::kRgb332:
      return {8, 8, 4};
    case display::PixelFormat::kBitPlanes3:
      return {2, 2, 2};
  }
  return {2, 2, 2};
}

// Writes a pixel into a picture of zeros. `q`: less than LevelsOf(format).
VOXELD_HD inline void PackPixel(display::PixelFormat format, uint32_t width, uint32_t height,
                                uint32_t u, uint32_t v, Levels q, uint8_t* picture) {
  switch (format) {
    case display::PixelFormat::kRgb888: {
      uint8_t* pixel = picture + (static_cast<size_t>(v) * width + u) * 3;
      pixel[0] = static_cast<uint8_t>(q.r);
      pixel[1] = static_cast<uint8_t>(q.g);
      pixel[2] = static_cast<uint8_t>(q.b);
      break;
    }
    case display::PixelFormat::kRgb332:
      picture[static_cast<size_t>(v) * width + u] = static_cast<uint8_t>(q.r << 5 | q.g << 2 | q.b);
      break;
    case display::PixelFormat::kBitPlanes3: {
      const size_t row = (width + 7) / 8, plane = row * height;
      uint8_t* byte = picture + v * row + u / 8;
      const uint32_t shift = 7 - u % 8;
      byte[0] = static_cast<uint8_t>(byte[0] | q.r << shift);
      byte[plane] = static_cast<uint8_t>(byte[plane] | q.g << shift);
      byte[2 * plane] = static_cast<uint8_t>(byte[2 * plane] | q.b << shift);
      break;
    }
  }
}

}  // namespace voxeld::gpu
