// Writes a pixel's levels into a slice image's bytes. Host and device.
#pragma once

#include <cstddef>
#include <cstdint>

#include "display/api/frame_layout.h"
#include "gpu/portable.h"
#include "gpu/slice/quantize.h"

namespace voxeld::gpu {

// Levels of red, green and blue. For kPlanes24: bit t is the level in the t-th part of the
// sub-frame.
struct Levels {
  uint32_t r, g, b;
};

// Returns the number of levels of each channel. `bits`: FrameLayout::bits_per_channel().
VOXELD_HD constexpr Levels LevelsOf(display::PixelFormat format, uint32_t bits) {
  if (format == display::PixelFormat::kRgb332) return {8, 8, 4};
  if (format == display::PixelFormat::kPlanes24) return {2, 2, 2};
  return {1u << bits, 1u << bits, 1u << bits};
}

// Returns the three bytes of a pixel of kPlanes24: bit 3·t + c.
VOXELD_HD inline uint32_t Planes24(Levels q) {
  uint32_t word = 0;
  for (uint32_t t = 0; t < display::kProjectorParts; ++t) {
    word |= ((q.r >> t & 1) | (q.g >> t & 1) << 1 | (q.b >> t & 1) << 2) << (3 * t);
  }
  return word;
}

// The properties that all pixels of a slice image share.
struct PictureShape {
  display::PixelFormat format;
  uint32_t bits;  // FrameLayout::bits_per_channel()
  uint32_t width, height;
};

// Writes a pixel into a slice image of zeros. Requires: `q` is less than LevelsOf, or bits of
// kPlanes24.
VOXELD_HD inline void PackPixel(const PictureShape& shape, uint32_t u, uint32_t v, Levels q,
                                uint8_t* picture) {
  const size_t pixel = static_cast<size_t>(v) * shape.width + u;
  switch (shape.format) {
    case display::PixelFormat::kRgb888:
      picture[3 * pixel] = static_cast<uint8_t>(q.r);
      picture[3 * pixel + 1] = static_cast<uint8_t>(q.g);
      picture[3 * pixel + 2] = static_cast<uint8_t>(q.b);
      break;
    case display::PixelFormat::kRgb332:
      picture[pixel] = static_cast<uint8_t>(q.r << 5 | q.g << 2 | q.b);
      break;
    case display::PixelFormat::kBitPlanes: {
      const size_t row = (shape.width + 7) / 8, plane = row * shape.height;
      uint8_t* byte = picture + v * row + u / 8;
      const uint32_t shift = 7 - u % 8;
      for (uint32_t bit = shape.bits; bit-- > 0; byte += 3 * plane) {
        byte[0] = static_cast<uint8_t>(byte[0] | (q.r >> bit & 1) << shift);
        byte[plane] = static_cast<uint8_t>(byte[plane] | (q.g >> bit & 1) << shift);
        byte[2 * plane] = static_cast<uint8_t>(byte[2 * plane] | (q.b >> bit & 1) << shift);
      }
      break;
    }
    case display::PixelFormat::kHub75: {
      const uint32_t half = shape.height / 2, shift = v < half ? 0 : 3;
      uint8_t* byte = picture + static_cast<size_t>(v % half) * shape.width + u;
      for (uint32_t bit = shape.bits; bit-- > 0; byte += static_cast<size_t>(half) * shape.width) {
        const uint32_t rgb = (q.r >> bit & 1) | (q.g >> bit & 1) << 1 | (q.b >> bit & 1) << 2;
        *byte = static_cast<uint8_t>(*byte | rgb << shift);
      }
      break;
    }
    case display::PixelFormat::kPlanes24: {
      const uint32_t word = Planes24(q);
      for (uint32_t i = 0; i < 3; ++i) {
        picture[3 * pixel + i] = static_cast<uint8_t>(word >> (8 * i));
      }
      break;
    }
  }
}

}  // namespace voxeld::gpu
