// Text: letters of the server's fonts into polygons, solids, curves or strokes, whose voxels they then have.
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
