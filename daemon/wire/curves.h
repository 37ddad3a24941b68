// Lines that bend, surfaces made of Bézier patches, and shapes as lines or dots: the wire's fields into
// control points.
#pragma once

#include "daemon/wire/check.h"
#include "daemon/wire/context.h"
#include "gpu/primitives/wire_frame.h"

namespace voxeld::v1 {
class Arc;
class BezierSurface;
class Curve;
class Ellipse;
class Helix;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Each fills record, arrays and bounds of `out`, all but the colour.
MaybeFault ToArc(const FieldPath& path, const v1::Arc& in, const DecodeContext& context,
                 GeometryData* out);
MaybeFault ToEllipse(const FieldPath& path, const v1::Ellipse& in, const DecodeContext& context,
                     GeometryData* out);
MaybeFault ToHelix(const FieldPath& path, const v1::Helix& in, const DecodeContext& context,
                   GeometryData* out);

// Of what has vertices, first these are read as they were sent; then, when they have their colours, they become
// control points.
MaybeFault ReadCurve(const FieldPath& path, const v1::Curve& in, const DecodeContext& context,
                     GeometryData* out);
MaybeFault ToSpline(const FieldPath& path, const v1::Curve& in, const DecodeContext& context,
                    GeometryData* out);
MaybeFault ReadBezierSurface(const FieldPath& path, const v1::BezierSurface& in,
                             const DecodeContext& context, GeometryData* out);
MaybeFault ToPatches(const FieldPath& path, const v1::BezierSurface& in,
                     const DecodeContext& context, GeometryData* out);

// Cubic Béziers, cut as the record says.
MaybeFault SetSpans(const FieldPath& path, const gpu::Spans& spans, const DecodeContext& context,
                    GeometryData* out);
// A shape's lines, or its dots.
MaybeFault ToWireFrame(const FieldPath& path, const gpu::WireFrame& frame, bool dots,
                       const DecodeContext& context, GeometryData* out);
// A mesh that has been read: the lines between its vertices, each once, or as dots those that triangles have.
MaybeFault ToMeshFrame(const FieldPath& path, bool dots, const DecodeContext& context,
                       GeometryData* out);

}  // namespace voxeld::daemon::wire
