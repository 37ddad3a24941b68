// Converts height maps (voxeld.v1.HeightMap) to triangles.
//
// Guarantee: like its triangles (gpu/primitives/triangle.h), the surface has no gaps.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class HeightMap;
}

namespace voxeld::daemon::wire {

// Fills record, arrays and bounds of `out`, but neither the uniform colour nor the picture.
MaybeFault ToHeightMap(const FieldPath& path, const v1::HeightMap& in, const DecodeContext& context,
                       GeometryData* out);
// Adds the picture over the surface, if there is one. Call it after the colours are set.
MaybeFault AddHeightMapPicture(const FieldPath& path, const v1::HeightMap& in,
                               const DecodeContext& context, GeometryData* out);

}  // namespace voxeld::daemon::wire
