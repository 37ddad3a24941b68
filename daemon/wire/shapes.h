// Converts shapes that use the general method (gpu/primitives/) to programs.
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
  const v1::ColorScale* scale = nullptr;  // replaces the uniform colour; may be null
};

// Converts a shape to a field, without style: program, domain and bounds.
MaybeFault ToField(const FieldPath& path, const ShapeContext& context, gpu::implicit::Graph& graph,
                   const gpu::implicit::FieldShape& made, GeometryData* out);

// Each function fills record, program and bounds of `out`, but not the colour.
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
