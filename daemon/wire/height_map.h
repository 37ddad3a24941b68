// Height maps (voxeld.v1.HeightMap) into triangles.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class HeightMap;
}

namespace voxeld::daemon::wire {

// Fills record, arrays and bounds of `out`, all but the uniform colour.
MaybeFault ToHeightMap(const FieldPath& path, const v1::HeightMap& in, const DecodeContext& context,
                       GeometryData* out);

}  // namespace voxeld::daemon::wire
