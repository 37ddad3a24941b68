// Helices. Callers use display/geometry/footprint.h, where the contracts are.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/geometry/angle.h"
#include "display/geometry/cells.h"

namespace voxeld::display {

// The picture's axes.
PixelRow HelixRowU(const Helix& helix);
PixelRow HelixRowV(const Helix& helix);

// The middle of step `step`'s part of a turn, from where the blades begin.
Turn HelixTurn(const Helix& helix, int32_t step);

// Which part of a blade's height, 0 to 1, is at azimuth `turn` as blade 0 begins at `begin`; below 0: there is none.
double BladeShare(const Helix& helix, Turn turn, Turn begin);

}  // namespace voxeld::display
