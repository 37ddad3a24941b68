// A spiral galaxy, made up: no measured one.
#pragma once

#include <cstdint>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// How high it reaches, in its radii.
inline constexpr double kGalaxyHeight = 0.2;

// `stars` points within a radius of 1 about the origin, in the plane of x and y: a bulge of old, warm stars; two arms along
// logarithmic spirals, young and blue, with pink clouds; and a thin disc. The same stars for the same seed, on every machine.
Model GalaxyModel(uint64_t seed, uint32_t stars);

}  // namespace voxeld::voxelctl
