// Helices. Callers use display/geometry/footprint.h, which has the contracts.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/geometry/angle.h"
#include "display/geometry/cells.h"

namespace voxeld::display {

// The axes of the slice image.
PixelRow HelixRowU(const Helix& helix);
PixelRow HelixRowV(const Helix& helix);

// Returns the middle of step `step`'s part of a turn, from where the blades begin.
Turn HelixTurn(const Helix& helix, int32_t step);

// Returns the fraction of a blade's height, 0 to 1, at azimuth `turn` if blade 0 begins at `begin`;
// below 0: no blade is there.
double BladeShare(const Helix& helix, Turn turn, Turn begin);

}  // namespace voxeld::display
