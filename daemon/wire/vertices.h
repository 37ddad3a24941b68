// Packed arrays of a primitive (voxeld.v1.Vertices) into the engine's form.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/local_ranges.h"

namespace voxeld::v1 {
class Vertices;
}

namespace voxeld::daemon::wire {

// Fills counts, arrays, colour mode and bounds of `out`. Every size is compared in 64 bits before a
// byte is read. `with_indices` false: indices are refused. Payloads may lie in `ranges` instead.
MaybeFault ToVertices(const FieldPath& path, const v1::Vertices& in, bool with_indices,
                      const Limits& limits, LocalRanges& ranges, GeometryData* out);

}  // namespace voxeld::daemon::wire
