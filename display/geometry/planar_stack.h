// Planar stacks. Callers use display/geometry/footprint.h, which has the contracts.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/cells.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

// The axes of the slice images: u along x; v along y or z.
PixelRow StackRowU(const PlanarStack& stack);
PixelRow StackRowV(const PlanarStack& stack);

// The bounds, along the normal, of all slabs.
struct StackDepth {
  double low_mm, high_mm;
};
StackDepth DepthOf(const PlanarStack& stack);

FootprintTable BuildStackFootprints(const PlanarStack& stack, const VoxelGrid& grid,
                                    Sampling sampling);
Vec3 StackPixelPosition(const PlanarStack& stack, int32_t slice, int32_t u, int32_t v);

}  // namespace voxeld::display
