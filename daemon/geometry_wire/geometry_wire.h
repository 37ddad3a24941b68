// A display's geometry as words of the wire, and back: alike at both ends. The way back looks at sizes before it takes memory;
// whether the geometry can be is ValidateGeometry's.
#pragma once

#include "absl/status/statusor.h"
#include "display/api/geometry.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/types.pb.h"

namespace voxeld::daemon::wire {

void ToWire(const display::Vec3& in, v1::Vec3* out);
void ToWire(const display::Geometry& in, v1::Geometry* out);

display::Vec3 FromWire(const v1::Vec3& in);
// InvalidArgument names the field, its value and what would be right.
absl::StatusOr<display::Geometry> FromWire(const v1::Geometry& in);

}  // namespace voxeld::daemon::wire
