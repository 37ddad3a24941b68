// Numbers that stand in a display's slices: which picture is shown where.
#pragma once

#include <cstdint>
#include <vector>

#include "display/api/geometry.h"

namespace voxeld::daemon {

struct NumberedVoxel {
  display::Vec3 at;  // within a voxel, in voxels of the geometry's grid
  uint32_t rgb = 0;
};

// The digits of every slice's number, of every n-th where there are more than 64, in the slice's own pixels, a colour in turn of
// eight; upright and not mirrored where pixels are where the geometry says. In a lattice, whose slices are rows of lights: a slice's
// first light white, the others in its colour.
std::vector<NumberedVoxel> SliceNumbers(const display::Geometry& geometry);

}  // namespace voxeld::daemon
