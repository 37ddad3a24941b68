// Shapes that are drawn by the general method (gpu/primitives/): the wire's fields into their programs.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"

namespace voxeld::v1 {
class Cone;
class Disc;
class Ellipsoid;
class Parallelepiped;
class Patch;
class Polygon;
class Torus;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Each fills record, program and bounds of `out`, all but the colour.
MaybeFault ToShape(const FieldPath& path, const v1::Cone& in, const Limits& limits,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Disc& in, const Limits& limits,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Ellipsoid& in, const Limits& limits,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Parallelepiped& in, const Limits& limits,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Patch& in, const Limits& limits,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Polygon& in, const Limits& limits,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Torus& in, const Limits& limits,
                   GeometryData* out);

}  // namespace voxeld::daemon::wire
