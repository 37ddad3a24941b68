// Volumes and isosurfaces: the wire's grids into the engine's samples.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Isosurface;
class Volume;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

struct ShapeContext;

// A group of one: the samples, under the map from their own coordinates. `color`: 0xRRGGBB. What it is called,
// and what was sent, is the caller's.
MaybeFault ToVolume(const FieldPath& path, const v1::Volume& in, uint32_t color,
                    const DecodeContext& context, GroupData* out);
// By `shape` also the scale, if there is one.
MaybeFault ToIsosurface(const FieldPath& path, const v1::Isosurface& in, uint32_t color,
                        const ShapeContext& shape, GroupData* out);

}  // namespace voxeld::daemon::wire
