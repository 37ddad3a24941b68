// Footprints that are no products, pixel by pixel: of a helix, of panels that are tilted, and with a correction. Callers use
// display/geometry/footprint.h, where the contracts are.
#pragma once

#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "display/geometry/footprint.h"

namespace voxeld::display {

// Whether a geometry's footprints are kept pixel by pixel.
bool IsFlat(const Geometry& geometry);

// Pixels in a row of a flat table, those that fill it up to whole bytes of bits included.
inline int32_t FlatRow(int32_t width_px) { return (width_px + 7) / 8 * 8; }

// `geometry` is valid, and no lattice.
FootprintTable BuildFlatFootprints(const Geometry& geometry, Sampling sampling);

}  // namespace voxeld::display
