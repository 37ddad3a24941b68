// Boxes, spheres and cylinders: records without a program. With lines or dots, a shell, or a colour scale they are
// parallelepipeds, ellipsoids and cones.
#pragma once

#include "daemon/wire/shapes.h"

namespace voxeld::v1 {
class Box;
class Cylinder;
class Sphere;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Each fills record, arrays and bounds of `out`, all but one colour.
MaybeFault ToBox(const FieldPath& path, const v1::Box& in, const ShapeContext& context,
                 GeometryData* out);
MaybeFault ToSphere(const FieldPath& path, const v1::Sphere& in, const ShapeContext& context,
                    GeometryData* out);
MaybeFault ToCylinder(const FieldPath& path, const v1::Cylinder& in, const ShapeContext& context,
                      GeometryData* out);

}  // namespace voxeld::daemon::wire
