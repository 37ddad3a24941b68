// Reads fields that several primitives share.
#pragma once

#include "daemon/wire/check.h"
#include "gpu/implicit/field_shape.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {

MaybeFault ToThickness(const FieldPath& path, const v1::Thickness& in, const Limits& limits,
                       gpu::GeometryRecord* out);
// Reads the shell of a surface of triangles. Other than 0 it is refused if the shape is drawn as
// something else.
MaybeFault ToShell(const FieldPath& path, const v1::Thickness& in, bool is_surface,
                   const Limits& limits, gpu::GeometryRecord* out);
MaybeFault ToVector(const FieldPath& path, const v1::Vec3& in, gpu::implicit::Vector* out);
// Does CheckFloat, and checks that the value is 0 or greater.
MaybeFault CheckNotNegative(const FieldPath& path, double value);
// `path` is that of the message with the sampling, rule or fill.
MaybeFault ToSampling(const FieldPath& path, v1::LineSampling in, gpu::GeometryRecord* out);
MaybeFault ToRule(const FieldPath& path, v1::SurfaceRule in, gpu::GeometryRecord* out);
// LINES and DOTS are left to the caller: `*framed` is set for them.
MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out, bool* framed);
// For shapes that support neither LINES nor DOTS.
MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out);

}  // namespace voxeld::daemon::wire
