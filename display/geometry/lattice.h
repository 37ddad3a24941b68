// Lattices. Callers use display/geometry/footprint.h, which has the contracts.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

int32_t LatticeSlices(const Lattice& lattice);

// The bounds, on each axis, of all lights' boxes.
struct LightBounds {
  Vec3 low_mm, high_mm;
};
LightBounds BoundsOf(const Lattice& lattice);

FootprintTable BuildLatticeFootprints(const Lattice& lattice, const VoxelGrid& grid);
Vec3 LatticePixelPosition(const Lattice& lattice, int32_t slice, int32_t u);

}  // namespace voxeld::display
