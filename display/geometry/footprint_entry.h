// A voxel of a footprint (footprint.h), as engines store it in their own memory.
#pragma once

#include <cstdint>

namespace voxeld::display {

inline constexpr uint16_t kFullWeight = 255;
// least weight of the voxel that contains a pixel's centre
inline constexpr uint16_t kOwnWeight = 128;

struct FootprintEntry {
  uint16_t x = 0, y = 0, z = 0;
  uint16_t weight = kFullWeight;  // 1 to 255
  bool operator==(const FootprintEntry&) const = default;
};

}  // namespace voxeld::display
