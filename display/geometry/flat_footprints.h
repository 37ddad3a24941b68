// Footprints that are not products but lists per pixel: for a helix, tilted panels, and
// corrections. Callers use display/geometry/footprint.h, which has the contracts.
#pragma once

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

// Returns whether a geometry's footprints are stored per pixel.
bool IsFlat(const Geometry& geometry);

// Returns the pixels in a row of a flat table, padded to whole bytes of bits.
inline int32_t FlatRow(int32_t width_px) { return (width_px + 7) / 8 * 8; }

// Requires: `geometry` is valid, and not a lattice.
FootprintTable BuildFlatFootprints(const Geometry& geometry, Sampling sampling);

}  // namespace voxeld::display
