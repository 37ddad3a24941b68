// Converts boxes, spheres and cylinders to records without a program. With lines or dots, a shell,
// or a colour scale they become parallelepipeds, ellipsoids and cones.
#pragma once

#include "daemon/wire/shapes.h"

namespace voxeld::v1 {
class Box;
class Cylinder;
class Sphere;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Each function fills record, arrays and bounds of `out`, but not the uniform colour.
MaybeFault ToBox(const FieldPath& path, const v1::Box& in, const ShapeContext& context,
                 GeometryData* out);
MaybeFault ToSphere(const FieldPath& path, const v1::Sphere& in, const ShapeContext& context,
                    GeometryData* out);
MaybeFault ToCylinder(const FieldPath& path, const v1::Cylinder& in, const ShapeContext& context,
                      GeometryData* out);

}  // namespace voxeld::daemon::wire
