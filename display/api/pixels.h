// From packed pictures back to light: what an eye sees of the formats that displays take.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "display/api/slice_frame.h"

namespace voxeld::display {

// The light of one slice: `pictures` are its layout.sub_frames pictures, each of
// layout.bytes_per_slice() bytes; `rgb` takes width·height·3 bytes, row-major. A channel of n bits
// at value v is v·255/(2ⁿ−1), rounded to the nearest (in kPlanes24 the eight parts are
// averaged before); sub-frames are averaged, a half rounded up.
void SliceToRgb(const FrameLayout& layout, std::span<const std::span<const std::byte>> pictures,
                std::span<uint8_t> rgb);

// How much of a picture's full light is on, 0 to 1: the mean of its levels.
double LightOf(const FrameLayout& layout, std::span<const std::byte> picture);

// The whole of a frame, slice after slice.
std::vector<uint8_t> FrameToRgb(const SliceFrame& frame);

}  // namespace voxeld::display
