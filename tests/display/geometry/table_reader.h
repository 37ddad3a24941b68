// Reads footprint tables as an engine does, for tests.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "display/geometry/footprint.h"

namespace voxeld::display {

// Maps voxel (x, y, z) to its weight.
using Footprint = std::map<std::array<int32_t, 3>, int32_t>;

Footprint ReadFootprint(const FootprintTable& table, int32_t slice, int32_t u, int32_t v);

// Returns, for every voxel (x fastest), the greatest weight with which any pixel shows it.
std::vector<int32_t> GreatestWeights(const FootprintTable& table, const VoxelGrid& grid);

}  // namespace voxeld::display
