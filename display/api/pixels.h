// Converts packed slice images back to light: what an eye sees of the displays' formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "display/api/slice_frame.h"

namespace voxeld::display {

// Writes the light of one slice: `pictures` are its layout.sub_frames images, each of
// layout.bytes_per_slice() bytes; `rgb` takes width·height·3 bytes, row-major. A channel of n bits
// at value v is v·255/(2ⁿ−1), rounded to the nearest (in kPlanes24 the eight parts are averaged
// before); sub-frames are averaged, a half rounded up.
void SliceToRgb(const FrameLayout& layout, std::span<const std::span<const std::byte>> pictures,
                std::span<uint8_t> rgb);

// Returns the share of a slice image's full light that is on, 0 to 1: the mean of its levels.
double LightOf(const FrameLayout& layout, std::span<const std::byte> picture);

// Returns the light of a whole frame, slice after slice.
std::vector<uint8_t> FrameToRgb(const SliceFrame& frame);

}  // namespace voxeld::display
