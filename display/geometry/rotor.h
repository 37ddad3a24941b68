// Rotors. Callers use display/geometry/footprint.h, which has the contracts.
#pragma once

#include <cstdint>

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/angle.h"
#include "display/geometry/cells.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

// The axes of a panel's slice images: u along its plane, measured from the foot of the
// perpendicular from the axis; v along z, or along the panel's own v axis if it is tilted.
PixelRow PanelRowU(const Rotor& rotor, const Rotor::Panel& panel);
PixelRow PanelRowV(const Rotor& rotor, const Rotor::Panel& panel);

// Returns the direction of u at the middle of step `step` (0 to slices_per_turn − 1).
Turn PanelTurn(const Rotor& rotor, const Rotor::Panel& panel, int32_t step);

// The components of a panel's v axis: along z, and away from the axis.
struct Lean {
  double cos, sin;
};
Lean LeanOf(const Rotor::Panel& panel);
bool IsTilted(const Rotor& rotor);

// Returns the greatest distance from the axis of any point of any panel.
double RadiusMm(const Rotor& rotor);

FootprintTable BuildRotorFootprints(const Rotor& rotor, const VoxelGrid& grid, Sampling sampling);
Vec3 RotorPixelPosition(const Rotor& rotor, int32_t slice, int32_t u, int32_t v);

}  // namespace voxeld::display
