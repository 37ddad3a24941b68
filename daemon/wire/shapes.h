// Shapes that are drawn by the general method (gpu/primitives/): the wire's fields into their programs.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"
#include "gpu/implicit/field_shape.h"

namespace voxeld::v1 {
class Arrow;
class ColorScale;
class Cone;
class Disc;
class Ellipsoid;
class Parallelepiped;
class Patch;
class Polygon;
class Torus;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

struct ShapeContext {
  const DecodeContext& context;
  const FieldPath& scale_path;
  const v1::ColorScale* scale = nullptr;  // in place of one colour, if there is one
};

// A shape as a field, all but its look: program, domain and bounds.
MaybeFault ToField(const FieldPath& path, const ShapeContext& context, gpu::implicit::Graph& graph,
                   const gpu::implicit::FieldShape& made, GeometryData* out);

// Each fills record, program and bounds of `out`, all but the colour.
MaybeFault ToShape(const FieldPath& path, const v1::Arrow& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Cone& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Disc& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Ellipsoid& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Parallelepiped& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Patch& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Polygon& in, const ShapeContext& context,
                   GeometryData* out);
MaybeFault ToShape(const FieldPath& path, const v1::Torus& in, const ShapeContext& context,
                   GeometryData* out);

}  // namespace voxeld::daemon::wire
