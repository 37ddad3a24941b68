// Packed arrays of a primitive (voxeld.v1.Vertices) into the engine's form.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Vertices;
}

namespace voxeld::daemon::wire {

// Fills counts, arrays, colour mode and bounds of `out`. Every size is compared in 64 bits before a
// byte is read; then each payload is read once, converted and checked on its way into
// `context.pool`. `with_indices` false: indices are refused. Payloads may lie in
// `context.ranges` instead. Colours of elements are left to ToElementColors.
MaybeFault ToVertices(const FieldPath& path, const v1::Vertices& in, bool with_indices,
                      const DecodeContext& context, GeometryData* out);

// Colours of each segment or triangle (Vertices.ELEMENTS), if there are such: of what ToVertices has read, and whose corners have
// been counted. Each becomes one with corners of its own.
MaybeFault ToElementColors(const FieldPath& path, const v1::Vertices& in,
                           const DecodeContext& context, GeometryData* out);

}  // namespace voxeld::daemon::wire
