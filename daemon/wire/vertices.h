// Converts packed arrays of a primitive (voxeld.v1.Vertices) to the engine's form.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Vertices;
}

namespace voxeld::daemon::wire {

// Fills counts, arrays, colour mode and bounds of `out`. Compares every size in 64 bits before
// reading a byte, then reads each payload once, converting and checking it on its way into
// `context.pool`. `with_indices` false: indices are refused. `context.ranges` may contain the
// payloads. ToElementColors handles colours of elements.
MaybeFault ToVertices(const FieldPath& path, const v1::Vertices& in, bool with_indices,
                      const DecodeContext& context, GeometryData* out);

// Handles colours of segments or triangles (Vertices.ELEMENTS), if there are any. Requires:
// ToVertices has read `out`, and its corners have been counted. Each element gets separate corners.
MaybeFault ToElementColors(const FieldPath& path, const v1::Vertices& in,
                           const DecodeContext& context, GeometryData* out);

}  // namespace voxeld::daemon::wire
