// From a channel to a display's levels under ordered dither, as two bytes that all thresholds share.
//
// Of the 64 thresholds that Threshold() (quantize.h) makes (so not of blue noise), rising with the value b of the matrix, the greatest `rise`
// lift a channel to the level above: its level under b is base + (rise > 63 − b). So what a pixel needs of its place is
// one comparison, and the rest is the voxel's alone.
#pragma once

#include <cstdint>

#include "display/api/slice_frame.h"

namespace voxeld::gpu {

// Without dither no rise is above 0.
struct LevelTables {
  static constexpr int kRed = 0, kGreen = 1, kBlue = 2;

  alignas(64) uint8_t base[3][256];
  alignas(64) uint8_t rise[3][256];

  static LevelTables Of(const display::FrameLayout& layout, const display::Tone& tone);
  // `base` holds a channel's level where it lies in the byte.
  static LevelTables OfRgb332(const display::FrameLayout& layout, const display::Tone& tone);
};

// 63 − b of pixel column u, eight rows from a multiple of 8 on, a byte each, the first in the lowest.
uint64_t DitherColumn(uint32_t u, uint32_t sub, uint32_t sub_frames);

}  // namespace voxeld::gpu
