#include "daemon/wire/curves.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/check.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/vertices.h"
#include "gpu/primitives/helix.h"
#include "gpu/primitives/spline.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Vector;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kMostTurns = 1024;
constexpr uint32_t kPatchPoints = 16;

// Computes two directions across an axis. `message` has the field `toward`, which may be absent.
template <typename Message>
MaybeFault ToFrame(const FieldPath& path, const Message& in, const char* axis_name,
                   const Vector& axis, Vector* u, Vector* v) {
  if (!in.has_toward()) {
    if (gpu::FrameOf(axis, {1, 0, 0}, u, v) || gpu::FrameOf(axis, {0, 1, 0}, u, v)) return {};
    return Fault{FieldPath(path, axis_name).ToString(), Reason::kInvalidValue,
                 "has no direction; give one that is not 0"};
  }
  const FieldPath at(path, "toward");
  Vector toward;
  if (auto fault = ToVector(at, in.toward(), &toward)) return fault;
  if (gpu::FrameOf(axis, toward, u, v)) return {};
  return Fault{at.ToString(), Reason::kInvalidValue,
               absl::StrCat("lies along ", axis_name, "; give a direction across it")};
}

// Reads sampling and thickness of any message that has them.
template <typename Message>
MaybeFault ToLine(const FieldPath& path, const Message& in, const Limits& limits,
                  gpu::GeometryRecord* out) {
  if (auto fault = ToSampling(path, in.sampling(), out)) return fault;
  return ToThickness(FieldPath(path, "thickness"), in.thickness(), limits, out);
}

template <typename Message>
MaybeFault ToSweep(const FieldPath& path, const Message& in, double* start, double* sweep) {
  if (auto fault = CheckFloat(FieldPath(path, "start"), in.start())) return fault;
  if (auto fault = CheckFloat(FieldPath(path, "sweep"), in.sweep())) return fault;
  *start = in.start();
  *sweep = in.sweep() == 0 ? kTurn : in.sweep();
  if (std::fabs(*sweep) <= kTurn + 1e-6) return {};
  return Fault{FieldPath(path, "sweep").ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", Show(in.sweep()), "; give -2π to 2π")};
}

// Sets `points` and their bounds, which contain the curves as well.
MaybeFault SetPoints(const FieldPath& path, std::span<const Vector> points,
                     std::span<const uint32_t> colors, gpu::BulkPool* pool, GeometryData* out) {
  out->record.vertex_count = static_cast<uint32_t>(points.size());
  if (!colors.empty()) out->record.color_mode = gpu::ColorMode::kPerVertex;
  absl::StatusOr<gpu::GeometryArrays> arrays = gpu::GeometryArrays::Allocate(out->record, pool);
  if (!arrays.ok()) {
    return Fault{path.ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("cannot be kept: ", arrays.status().message())};
  }
  for (size_t i = 0; i < points.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      const float position = static_cast<float>(points[i][a]);
      if (!std::isfinite(position)) {
        return Fault{path.ToString(), Reason::kOutOfRange,
                     absl::StrCat("reaches to ", Show(points[i][a]),
                                  ", beyond what single precision holds; give it a transform")};
      }
      arrays->writable_positions()[i * 3 + static_cast<size_t>(a)] = position;
      const double value = static_cast<double>(position);
      out->min[a] = i == 0 ? value : std::min(out->min[a], value);
      out->max[a] = i == 0 ? value : std::max(out->max[a], value);
    }
  }
  std::copy(colors.begin(), colors.end(), arrays->writable_colors().begin());
  out->arrays = *std::move(arrays);
  return {};
}

Vector PointOf(const GeometryData& data, size_t i) {
  const float* p = &data.arrays.positions()[i * 3];
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

MaybeFault CheckVertexCount(const FieldPath& path, uint64_t count, const Limits& limits) {
  if (count <= limits.max_vertices_per_entity) return {};
  return Fault{path.ToString(), Reason::kQuotaExceeded,
               absl::StrCat("makes ", count, " control points; max_vertices_per_entity is ",
                            limits.max_vertices_per_entity)};
}

// Returns: the points of a patch that define its surface, the curves along its edges, or its
// corners.
std::span<const uint8_t> ControlPointsOf(v1::Fill fill) {
  static constexpr uint8_t kAll[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  static constexpr uint8_t kEdges[] = {0, 1, 2, 3, 12, 13, 14, 15, 0, 4, 8, 12, 3, 7, 11, 15};
  static constexpr uint8_t kCorners[] = {0, 3, 12, 15};
  if (fill == v1::FILL_LINES) return kEdges;
  if (fill == v1::FILL_DOTS) return kCorners;
  return kAll;
}

}  // namespace

MaybeFault SetSpans(const FieldPath& path, const gpu::Spans& spans, const DecodeContext& context,
                    GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kCurves;
  out->record.topology = gpu::Topology::kList;
  return SetPoints(path, spans.points(), {}, context.pool, out);
}

MaybeFault ReadCurve(const FieldPath& path, const v1::Curve& in, const DecodeContext& context,
                     GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kCurves;
  if (auto fault = ToLine(path, in, context, &out->record)) return fault;
  return ToVertices(FieldPath(path, "vertices"), in.vertices(), false, context, out);
}

MaybeFault ToSpline(const FieldPath& path, const v1::Curve& in, const DecodeContext& context,
                    GeometryData* out) {
  gpu::Spline spline;
  const char* right = "2 or more, 3 where it is closed";
  switch (in.form()) {
    case v1::Curve::FORM_UNSPECIFIED:
    case v1::Curve::CATMULL_ROM:
      spline.form = gpu::SplineForm::kCatmullRom;
      break;
    case v1::Curve::B_SPLINE:
      spline.form = gpu::SplineForm::kBSpline;
      break;
    case v1::Curve::BEZIER:
      spline.form = gpu::SplineForm::kBezier;
      right = in.closed() ? "3 for each closed cubic Bézier" : "1 and 3 for each cubic Bézier";
      break;
    case v1::Curve::QUADRATIC:
      spline.form = gpu::SplineForm::kQuadratic;
      right =
          in.closed() ? "2 for each closed quadratic Bézier" : "1 and 2 for each quadratic Bézier";
      break;
    default:
      return UnknownEnum(FieldPath(path, "form"), in.form(),
                         "CATMULL_ROM, B_SPLINE, BEZIER, QUADRATIC");
  }
  spline.closed = in.closed();
  const size_t count = out->record.vertex_count;
  for (size_t i = 0; i < count; ++i) spline.points.push_back(PointOf(*out, i));
  const FieldPath vertices(path, "vertices");
  const FieldPath at(vertices, "count");
  if (!spline.Fits()) {
    return Fault{at.ToString(), Reason::kSizeMismatch,
                 absl::StrCat("is ", count, "; give ", right)};
  }
  if (auto fault = CheckVertexCount(at, count * 4, context)) return fault;
  gpu::Spans spans;
  spline.Make(spans);
  const gpu::GeometryArrays read = out->arrays;  // colours as sent
  std::vector<uint32_t> colors;
  if (!read.colors().empty()) {
    spline.ForEachJoint([&](size_t from, size_t to) {
      const uint32_t ends[2] = {read.colors()[from], read.colors()[to]};
      colors.insert(colors.end(), {ends[0], ends[0], ends[1], ends[1]});
    });
  }
  out->record.topology = gpu::Topology::kList;
  return SetPoints(vertices, spans.points(), colors, context.pool, out);
}

MaybeFault ReadBezierSurface(const FieldPath& path, const v1::BezierSurface& in,
                             const DecodeContext& context, GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kPatches;
  bool framed;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  if (in.fill() == v1::FILL_SOLID) {
    return Fault{FieldPath(path, "fill").ToString(), Reason::kInvalidValue,
                 "is FILL_SOLID, but it has no inside; give FILL_SURFACE, FILL_LINES or FILL_DOTS"};
  }
  if (auto fault = ToFill(path, in.fill(), &out->record, &framed)) return fault;
  if (auto fault = ToShell(path, in.shell(), !framed, context, &out->record)) return fault;
  return ToVertices(FieldPath(path, "vertices"), in.vertices(), true, context, out);
}

MaybeFault ToPatches(const FieldPath& path, const v1::BezierSurface& in,
                     const DecodeContext& context, GeometryData* out) {
  gpu::GeometryRecord& record = out->record;
  const v1::Fill fill = in.fill();
  const FieldPath vertices(path, "vertices");
  const bool indexed = record.index_count != 0;
  const uint32_t corners = indexed ? record.index_count : record.vertex_count;
  const FieldPath at(vertices, indexed ? "index_count" : "count");
  if (corners % kPatchPoints != 0) {
    return Fault{at.ToString(), Reason::kSizeMismatch,
                 absl::StrCat("is ", corners, "; give 16 for each patch")};
  }
  const std::span<const uint8_t> kept = ControlPointsOf(fill);
  const bool framed = fill == v1::FILL_LINES || fill == v1::FILL_DOTS;
  if (!indexed && !framed) return {};
  if (auto fault = CheckVertexCount(at, uint64_t{corners} / kPatchPoints * kept.size(), context)) {
    return fault;
  }
  const gpu::GeometryArrays read = out->arrays;
  std::vector<Vector> points;
  std::vector<uint32_t> colors;
  for (uint32_t patch = 0; patch < corners; patch += kPatchPoints) {
    for (size_t i = 0; i < kept.size(); ++i) {
      const uint32_t place = patch + kept[i];
      const uint32_t index = indexed ? read.indices()[place] : place;
      points.push_back(PointOf(*out, index));
      if (read.colors().empty()) continue;
      // A curve has the colours of its ends, each at two of its points.
      const uint32_t end =
          fill == v1::FILL_LINES ? patch + kept[i / 2 % 2 == 0 ? i / 4 * 4 : i / 4 * 4 + 3] : place;
      colors.push_back(read.colors()[indexed ? read.indices()[end] : end]);
    }
  }
  record.index_count = 0;
  if (fill == v1::FILL_LINES) {
    record.kind = gpu::PrimitiveKind::kCurves;
    record.topology = gpu::Topology::kList;
  } else if (fill == v1::FILL_DOTS) {
    record.kind = gpu::PrimitiveKind::kPoints;
  }
  return SetPoints(vertices, points, colors, context.pool, out);
}

MaybeFault ToArc(const FieldPath& path, const v1::Arc& in, const DecodeContext& context,
                 GeometryData* out) {
  Vector center, normal = {0, 0, 1}, u, v;
  double start, sweep;
  if (auto fault = ToVector(FieldPath(path, "center"), in.center(), &center)) return fault;
  if (in.has_normal()) {
    if (auto fault = ToVector(FieldPath(path, "normal"), in.normal(), &normal)) return fault;
  }
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  if (auto fault = ToFrame(path, in, "normal", normal, &u, &v)) return fault;
  if (auto fault = ToSweep(path, in, &start, &sweep)) return fault;
  if (auto fault = ToLine(path, in, context, &out->record)) return fault;
  gpu::Spans spans;
  spans.Arc(center, in.radius() * u, in.radius() * v, start, sweep);
  return SetSpans(path, spans, context, out);
}

MaybeFault ToEllipse(const FieldPath& path, const v1::Ellipse& in, const DecodeContext& context,
                     GeometryData* out) {
  Vector center, a, b;
  double start, sweep;
  if (auto fault = ToVector(FieldPath(path, "center"), in.center(), &center)) return fault;
  if (auto fault = ToVector(FieldPath(path, "axis_a"), in.axis_a(), &a)) return fault;
  if (auto fault = ToVector(FieldPath(path, "axis_b"), in.axis_b(), &b)) return fault;
  const double product = gpu::implicit::Length(a) * gpu::implicit::Length(b);
  if (!(gpu::implicit::Length(gpu::implicit::Cross(a, b)) > kLeastSine * product)) {
    return Fault{FieldPath(path, "axis_b").ToString(), Reason::kInvalidValue,
                 "spans no area with axis_a; give half axes in two directions"};
  }
  if (auto fault = ToSweep(path, in, &start, &sweep)) return fault;
  if (auto fault = ToLine(path, in, context, &out->record)) return fault;
  gpu::Spans spans;
  spans.Arc(center, a, b, start, sweep);
  return SetSpans(path, spans, context, out);
}

MaybeFault ToHelix(const FieldPath& path, const v1::Helix& in, const DecodeContext& context,
                   GeometryData* out) {
  gpu::Helix helix;
  if (auto fault = ToVector(FieldPath(path, "start"), in.start(), &helix.start)) return fault;
  if (auto fault = ToVector(FieldPath(path, "end"), in.end(), &helix.end)) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  helix.radius = helix.end_radius = in.radius();
  if (in.has_end_radius()) {
    if (auto fault = CheckNotNegative(FieldPath(path, "end_radius"), in.end_radius())) return fault;
    helix.end_radius = in.end_radius();
  }
  const Vector axis = helix.end - helix.start;
  if (!(gpu::implicit::Length(axis) > 0)) {
    return Fault{FieldPath(path, "end").ToString(), Reason::kInvalidValue,
                 "is where start is; give another point"};
  }
  const FieldPath turns(path, "turns");
  if (auto fault = CheckFloat(turns, in.turns())) return fault;
  if (in.turns() == 0 || std::fabs(in.turns()) > kMostTurns) {
    return Fault{
        turns.ToString(), Reason::kInvalidValue,
        absl::StrCat("is ", Show(in.turns()), "; give up to ", kMostTurns, " either way, not 0")};
  }
  helix.turns = in.turns();
  if (auto fault = ToFrame(path, in, "the axis", axis, &helix.u, &helix.v)) return fault;
  if (auto fault = ToLine(path, in, context, &out->record)) return fault;
  const double spans_needed = std::ceil(std::fabs(in.turns()) * gpu::Spans::kSpansPerTurn);
  if (auto fault = CheckVertexCount(turns, static_cast<uint64_t>(spans_needed) * 4, context)) {
    return fault;
  }
  gpu::Spans spans;
  helix.Make(spans);
  return SetSpans(path, spans, context, out);
}

MaybeFault ToWireFrame(const FieldPath& path, const gpu::WireFrame& frame, bool dots,
                       const DecodeContext& context, GeometryData* out) {
  out->record.fill = gpu::Fill::kSurface;
  if (!dots) return SetSpans(path, frame.lines, context, out);
  out->record.kind = gpu::PrimitiveKind::kPoints;
  return SetPoints(path, frame.dots, {}, context.pool, out);
}

MaybeFault ToMeshFrame(const FieldPath& path, bool dots, const DecodeContext& context,
                       GeometryData* out) {
  gpu::GeometryRecord& record = out->record;
  const gpu::GeometryArrays read = out->arrays;
  std::vector<uint32_t> indices(read.indices().begin(), read.indices().end());
  if (indices.empty()) {
    for (uint32_t i = 0; i < record.vertex_count; ++i) indices.push_back(i);
  }
  std::vector<uint32_t> kept;
  if (dots) {
    kept = std::move(indices);
    std::sort(kept.begin(), kept.end());
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    record.kind = gpu::PrimitiveKind::kPoints;
  } else {
    std::vector<std::pair<uint32_t, uint32_t>> edges;
    for (size_t i = 0; i + 3 <= indices.size(); i += 3) {
      for (size_t c = 0; c < 3; ++c)
        edges.push_back(std::minmax(indices[i + c], indices[i + (c + 1) % 3]));
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    for (const auto& [a, b] : edges) kept.insert(kept.end(), {a, b});
    record.kind = gpu::PrimitiveKind::kSegments;
    record.topology = gpu::Topology::kList;
  }
  record.index_count = static_cast<uint32_t>(kept.size());
  absl::StatusOr<gpu::GeometryArrays> arrays = gpu::GeometryArrays::Allocate(record, context.pool);
  if (!arrays.ok()) {
    return Fault{path.ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("cannot be kept: ", arrays.status().message())};
  }
  std::copy(read.positions().begin(), read.positions().end(), arrays->writable_positions().begin());
  std::copy(kept.begin(), kept.end(), arrays->writable_indices().begin());
  std::copy(read.colors().begin(), read.colors().end(), arrays->writable_colors().begin());
  out->arrays = *std::move(arrays);
  return {};
}

}  // namespace voxeld::daemon::wire
