// Even light: computes how much to dim a display's pixels where they crowd.
//
// Pixels are not spread evenly over a volume: near a rotor's axis hundreds pass each voxel, at its
// rim two; a screen that a crank moves is slow at the ends. A solid of one colour would be bright
// there and dim elsewhere. So each row of pixels has a factor of linear light, such that all cubes
// of kDensityCube voxels completely within reach have as much light as the sparsest of them has at
// full light: the most that is possible evenly.
//
// One pixel of every voxel, its keeper, has a factor of `least` or more, so that the voxel lights
// it alone whatever the dither. If a display has few levels, and voxels finer than its light,
// keepers alone can exceed the even light; coarser voxels help.
#pragma once

#include <cstdint>
#include <vector>

#include "display/api/geometry.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

inline constexpr int32_t kDensityCube = 4;

// Returns a factor for each outer row of the footprints (slice·width + u), 1 to 65535 = full light.
// An empty result means full light everywhere. A row's light counts for the voxels of its footprint
// in proportion to their weights. The same on every machine.
std::vector<uint16_t> EvenFactors(const FootprintTable& table, const VoxelGrid& grid,
                                  uint16_t least);

}  // namespace voxeld::display
