// Even light: by how much the pixels of a display are turned down where they crowd.
//
// Pixels are not spread evenly over a volume: near a rotor's axis each voxel is passed by hundreds, at its rim by two; a screen
// that a crank moves is slow at the ends. A solid of one colour would be bright there and dim elsewhere. So each row of
// pixels has a factor of linear light, such that cubes of kDensityCube voxels wholly within reach have as much light each as
// the sparsest of them has at full light: the most that can be had evenly.
//
// One pixel of every voxel, its keeper, has a factor of `least` or more, so that the voxel lights it by itself whatever the
// dither. Where a display has few levels and voxels are finer than its light is, keepers alone can be more light than is
// even; coarser voxels are what helps.
#pragma once

#include <cstdint>
#include <vector>

#include "display/api/geometry.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

inline constexpr int32_t kDensityCube = 4;

// Of each outer row of the footprints (slice·width + u), 1 to 65535 = full light. None: all are full. A row's light counts
// for the voxels of its footprint in proportion to their weights. The same on every machine.
std::vector<uint16_t> EvenFactors(const FootprintTable& table, const VoxelGrid& grid,
                                  uint16_t least);

}  // namespace voxeld::display
