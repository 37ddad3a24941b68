// Writes pixels into slice images of bytes.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gpu/cuda/types.h"
#include "gpu/slice/pack.h"

namespace voxeld::gpu::cuda {

// Writes a byte; returns true if it changed.
__device__ inline bool PutByte(uint8_t* at, uint32_t value) {
  if (*at == value) return false;
  *at = static_cast<uint8_t>(value);
  return true;
}

// Writes pixel (u, v) of a slice image in which each byte belongs to one pixel; returns true if it
// changed.
__device__ inline bool PutLevels(const SliceView& view, uint32_t u, uint32_t v, Levels q,
                                 uint8_t* picture) {
  const size_t pixel = static_cast<size_t>(v) * view.width + u;
  if (view.finish.format == display::PixelFormat::kRgb332) {
    return PutByte(picture + pixel, q.r << 5 | q.g << 2 | q.b);
  }
  if (view.finish.format == display::PixelFormat::kPlanes24) {
    const uint32_t word = Planes24(q);
    q = {word & 0xFF, word >> 8 & 0xFF, word >> 16};
  }
  bool differs = PutByte(picture + pixel * 3, q.r);
  differs |= PutByte(picture + pixel * 3 + 1, q.g);
  differs |= PutByte(picture + pixel * 3 + 2, q.b);
  return differs;
}

}  // namespace voxeld::gpu::cuda
