// Converts text to polygons, solids, curves or strokes with the server's fonts. Its voxels are those
// of these shapes.
//
// Guarantee: filled letters match their outlines within 1/1500 of a capital's height. Flat ones
// have the given thickness; outlines and strokes are curves (gpu/curves/cut.h).
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Primitive;
}

namespace voxeld::daemon::wire {

// `path` is that of the primitive. Letters become a group with shared geometries; lines become one
// geometry. `color`: 0xRRGGBB.
MaybeFault ToText(const FieldPath& path, const v1::Primitive& in, uint32_t color,
                  const DecodeContext& context, Content* out);

}  // namespace voxeld::daemon::wire
