// Converts a display's geometry to the protocol and back, for both server and clients. FromWire
// checks sizes before it allocates memory. ValidateGeometry checks whether the geometry is
// possible.
#pragma once

#include "absl/status/statusor.h"
#include "display/api/geometry.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/types.pb.h"

namespace voxeld::daemon::wire {

void ToWire(const display::Vec3& in, v1::Vec3* out);
void ToWire(const display::Geometry& in, v1::Geometry* out);

display::Vec3 FromWire(const v1::Vec3& in);
// Errors: InvalidArgument with the field, its value and the remedy.
absl::StatusOr<display::Geometry> FromWire(const v1::Geometry& in);

}  // namespace voxeld::daemon::wire
