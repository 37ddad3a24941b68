// Fields that several primitives have.
#pragma once

#include "daemon/wire/check.h"
#include "gpu/implicit/field_shape.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

MaybeFault ToThickness(const FieldPath& path, const v1::Thickness& in, const Limits& limits,
                       gpu::GeometryRecord* out);
// Of a surface of triangles; any but 0 is refused where it is drawn as something else.
MaybeFault ToShell(const FieldPath& path, const v1::Thickness& in, bool is_surface,
                   const Limits& limits, gpu::GeometryRecord* out);
MaybeFault ToVector(const FieldPath& path, const v1::Vec3& in, gpu::implicit::Vector* out);
// As CheckFloat, and 0 or greater.
MaybeFault CheckNotNegative(const FieldPath& path, double value);
// `path`: of what has the sampling, the rule, or the fill.
MaybeFault ToSampling(const FieldPath& path, v1::LineSampling in, gpu::GeometryRecord* out);
MaybeFault ToRule(const FieldPath& path, v1::SurfaceRule in, gpu::GeometryRecord* out);
// LINES and DOTS are the caller's to see to: `*framed` says that it is one of them.
MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out, bool* framed);
// Of what has neither.
MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out);

}  // namespace voxeld::daemon::wire
