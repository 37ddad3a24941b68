// Converts volumes and isosurfaces from the protocol's grids to the engine's samples.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Isosurface;
class Volume;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

struct ShapeContext;

// Creates a group of one part: the samples, with the map from their own coordinates. `color`:
// 0xRRGGBB. The caller sets the kind and the primitive as it was sent.
MaybeFault ToVolume(const FieldPath& path, const v1::Volume& in, uint32_t color,
                    const DecodeContext& context, GroupData* out);
// `shape` also contains the colour scale, if there is one.
MaybeFault ToIsosurface(const FieldPath& path, const v1::Isosurface& in, uint32_t color,
                        const ShapeContext& shape, GroupData* out);

}  // namespace voxeld::daemon::wire
