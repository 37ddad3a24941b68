// A generated spiral galaxy, not a measured one.
#pragma once

#include <cstdint>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Its height in radii.
inline constexpr double kGalaxyHeight = 0.2;

// Returns `stars` points within a radius of 1 about the origin, in the plane of x and y: a bulge of
// old, warm stars; two arms along logarithmic spirals, young and blue, with pink clouds; and a thin
// disc. The same seed gives the same stars on every machine.
Model GalaxyModel(uint64_t seed, uint32_t stars);

}  // namespace voxeld::voxelctl
