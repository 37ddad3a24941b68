// Text: letters of the server's fonts into polygons, solids, curves or strokes, whose voxels they then have.
//
// Guarantee: filled letters hold what their outlines do, but for 1/1500 of a capital's height; flat
// ones are as thick as they are said to be, outlines and strokes are curves (gpu/curves/cut.h).
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Primitive;
}

namespace voxeld::daemon::wire {

// `path`: of the primitive. Letters become a group, which share what they share; lines one geometry. `color`: 0xRRGGBB.
MaybeFault ToText(const FieldPath& path, const v1::Primitive& in, uint32_t color,
                  const DecodeContext& context, Content* out);

}  // namespace voxeld::daemon::wire
