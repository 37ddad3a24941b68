// Weights of footprints. Host and device.
#pragma once

#include <cstdint>

#include "gpu/portable.h"

namespace voxeld::gpu {

// Returns the weight of a voxel: outer times inner, each 1 to 255.
VOXELD_HD inline uint32_t FootprintWeight(uint32_t outer, uint32_t inner) {
  return (outer * inner + 127) / 255;
}

// Returns a channel (0 to 255) multiplied by a weight.
VOXELD_HD inline uint32_t WeighChannel(uint32_t weight, uint32_t c) {
  return (weight * c + 127) / 255;
}

// Returns, for each channel, the greater of `rgb` and the weighted `c`; 0x00RRGGBB.
VOXELD_HD inline uint32_t RaiseWeighted(uint32_t rgb, uint32_t weight, uint32_t c) {
  uint32_t result = 0;
  for (int shift = 0; shift < 24; shift += 8) {
    const uint32_t a = (rgb >> shift) & 0xFF, b = WeighChannel(weight, (c >> shift) & 0xFF);
    result |= (a < b ? b : a) << shift;
  }
  return result;
}

}  // namespace voxeld::gpu
