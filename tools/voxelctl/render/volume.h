// A captured volume, and a picture. Plain data types only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "display/api/geometry.h"

namespace voxeld::voxelctl {

// The content of a display: slices of width·height pixels, row-major, 8-bit RGB.
struct Volume {
  std::string display;
  uint64_t number = 0;
  display::Geometry geometry;
  int32_t slices = 0, width = 0, height = 0;
  std::vector<uint8_t> rgb;  // slices·height·width·3

  size_t slice_bytes() const {
    return static_cast<size_t>(width) * static_cast<size_t>(height) * 3;
  }
  const uint8_t* pixel(int32_t slice, int32_t u, int32_t v) const {
    return rgb.data() + static_cast<size_t>(slice) * slice_bytes() +
           (static_cast<size_t>(v) * static_cast<size_t>(width) + static_cast<size_t>(u)) * 3;
  }
};

// Row-major, the top row first, 8-bit sRGB.
struct Image {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;  // width·height·3
};

}  // namespace voxeld::voxelctl
