// Fields that several primitives have.
#pragma once

#include "daemon/wire/check.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

MaybeFault ToThickness(const FieldPath& path, const v1::Thickness& in, const Limits& limits,
                       gpu::GeometryRecord* out);
// `path`: of what has the rule, or the fill.
MaybeFault ToRule(const FieldPath& path, v1::SurfaceRule in, gpu::GeometryRecord* out);
MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out);

}  // namespace voxeld::daemon::wire
