// Pictures with few colours, which take little on disk.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tools/voxelctl/render/volume.h"

namespace voxeld::voxelctl {

struct PaletteImage {
  int width = 0, height = 0;
  std::vector<std::array<uint8_t, 3>> colors;  // at most 256
  std::vector<uint8_t> indices;                // of each pixel, in an Image's order
};

// With at most `most` colours, 1 to 256: its own if there are no more, else means of those that are
// alike (median cut: Heckbert, "Color image quantization for frame buffer display", 1982).
PaletteImage ReduceColors(const Image& image, int most);

}  // namespace voxeld::voxelctl
