// Converts a channel to a display's levels under ordered dither, as two bytes that serve all
// thresholds.
//
// Threshold() (quantize.h) makes 64 thresholds (so this does not apply to blue noise), which rise
// with the value b of the matrix. The greatest `rise` of them lift a channel to the level above:
// its level under b is base + (rise > 63 − b). So the pixel's place only decides one comparison,
// and everything else depends on the voxel alone.
#pragma once

#include <cstdint>

#include "display/api/slice_frame.h"

namespace voxeld::gpu {

// Without dither every rise is 0.
struct LevelTables {
  static constexpr int kRed = 0, kGreen = 1, kBlue = 2;

  alignas(64) uint8_t base[3][256];
  alignas(64) uint8_t rise[3][256];

  static LevelTables Of(const display::FrameLayout& layout, const display::Tone& tone);
  // `base` holds a channel's level at its place in the byte.
  static LevelTables OfRgb332(const display::FrameLayout& layout, const display::Tone& tone);
};

// Returns 63 − b for pixel column u, in eight rows from a multiple of 8 on: a byte each, the first
// in the lowest byte.
uint64_t DitherColumn(uint32_t u, uint32_t sub, uint32_t sub_frames);

}  // namespace voxeld::gpu
