// Height maps (voxeld.v1.HeightMap) into triangles.
//
// Guarantee: as its triangles (gpu/primitives/triangle.h): nothing gets through.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class HeightMap;
}

namespace voxeld::daemon::wire {

// Fills record, arrays and bounds of `out`, all but the uniform colour and the picture.
MaybeFault ToHeightMap(const FieldPath& path, const v1::HeightMap& in, const DecodeContext& context,
                       GeometryData* out);
// Then, when it has its colours, the picture that lies over it, if there is one.
MaybeFault AddHeightMapPicture(const FieldPath& path, const v1::HeightMap& in,
                               const DecodeContext& context, GeometryData* out);

}  // namespace voxeld::daemon::wire
