// Weights of footprints. Host and device.
#pragma once

#include <cstdint>

#include "gpu/portable.h"

namespace voxeld::gpu {

// Of a voxel: outer times inner, each 1 to 255.
VOXELD_HD inline uint32_t FootprintWeight(uint32_t outer, uint32_t inner) {
  return (outer * inner + 127) / 255;
}

// A channel (0 to 255) under a weight.
VOXELD_HD inline uint32_t WeighChannel(uint32_t weight, uint32_t c) {
  return (weight * c + 127) / 255;
}

// Per channel the greater of `rgb` and `c` under the weight; 0x00RRGGBB.
VOXELD_HD inline uint32_t RaiseWeighted(uint32_t rgb, uint32_t weight, uint32_t c) {
  uint32_t result = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const uint32_t a = (rgb >> shift) & 0xFF, b = WeighChannel(weight, (c >> shift) & 0xFF);
    result |= (a < b ? b : a) << shift;
  }
  return result;
}

}  // namespace voxeld::gpu
