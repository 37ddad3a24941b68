// Converts curved lines, surfaces of Bézier patches, and shapes drawn as lines or dots to control
// points.
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

// Each function fills record, arrays and bounds of `out`, but not the colour.
MaybeFault ToArc(const FieldPath& path, const v1::Arc& in, const DecodeContext& context,
                 GeometryData* out);
MaybeFault ToEllipse(const FieldPath& path, const v1::Ellipse& in, const DecodeContext& context,
                     GeometryData* out);
MaybeFault ToHelix(const FieldPath& path, const v1::Helix& in, const DecodeContext& context,
                   GeometryData* out);

// Reads the vertices as they were sent. A later step converts them to control points, after their
// colours are known.
MaybeFault ReadCurve(const FieldPath& path, const v1::Curve& in, const DecodeContext& context,
                     GeometryData* out);
MaybeFault ToSpline(const FieldPath& path, const v1::Curve& in, const DecodeContext& context,
                    GeometryData* out);
MaybeFault ReadBezierSurface(const FieldPath& path, const v1::BezierSurface& in,
                             const DecodeContext& context, GeometryData* out);
MaybeFault ToPatches(const FieldPath& path, const v1::BezierSurface& in,
                     const DecodeContext& context, GeometryData* out);

// Stores cubic Béziers, which are cut as the record specifies.
MaybeFault SetSpans(const FieldPath& path, const gpu::Spans& spans, const DecodeContext& context,
                    GeometryData* out);
// Converts a shape to lines or dots.
MaybeFault ToWireFrame(const FieldPath& path, const gpu::WireFrame& frame, bool dots,
                       const DecodeContext& context, GeometryData* out);
// Converts a mesh that has been read: to the lines between its vertices, each once, or to dots at
// the vertices that triangles use.
MaybeFault ToMeshFrame(const FieldPath& path, bool dots, const DecodeContext& context,
                       GeometryData* out);

}  // namespace voxeld::daemon::wire
