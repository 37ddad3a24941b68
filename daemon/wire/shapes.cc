#include "daemon/wire/shapes.h"

#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/boundary.h"
#include "daemon/wire/check.h"
#include "daemon/wire/color_scale.h"
#include "daemon/wire/curves.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/implicit.h"
#include "gpu/primitives/arrow.h"
#include "gpu/primitives/cone.h"
#include "gpu/primitives/disc.h"
#include "gpu/primitives/ellipsoid.h"
#include "gpu/primitives/parallelepiped.h"
#include "gpu/primitives/patch.h"
#include "gpu/primitives/polygon.h"
#include "gpu/primitives/torus.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Graph;
using gpu::implicit::Vector;

std::string ShowVector(const Vector& v) {
  return absl::StrCat("(", Show(v.x), ", ", Show(v.y), ", ", Show(v.z), ")");
}

template <typename Shape>
MaybeFault FinishShape(const FieldPath& path, const ShapeContext& context, const Shape& shape,
                       GeometryData* out) {
  Graph graph;
  return ToField(path, context, graph, shape.Make(graph), out);
}

template <typename Message>
inline constexpr bool kHasInside =
    !std::is_same_v<Message, v1::Disc> && !std::is_same_v<Message, v1::Patch> &&
    !std::is_same_v<Message, v1::Polygon>;

// Reads the fill and style of a shape that supports lines and dots. `*done`: it has been converted
// to these.
template <typename Message, typename Shape>
MaybeFault ToLookOrFrame(const FieldPath& path, const Message& in, const ShapeContext& context,
                         const Shape& shape, GeometryData* out, bool* done) {
  if (!kHasInside<Message> && in.fill() == v1::FILL_SOLID) {
    return Fault{FieldPath(path, "fill").ToString(), Reason::kInvalidValue,
                 "is FILL_SOLID, but it has no inside; give FILL_SURFACE, FILL_LINES or FILL_DOTS"};
  }
  if (auto fault = ToFill(path, in.fill(), &out->record, done)) return fault;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  const bool surface = !*done && out->record.fill == gpu::Fill::kSurface;
  if (auto fault = ToShell(path, in.shell(), surface, context.context, &out->record)) return fault;
  if (!*done) return {};
  return ToWireFrame(path, gpu::WireFrameOf(shape), in.fill() == v1::FILL_DOTS, context.context,
                     out);
}

}  // namespace

MaybeFault ToField(const FieldPath& path, const ShapeContext& context, Graph& graph,
                   const gpu::implicit::FieldShape& made, GeometryData* out) {
  gpu::implicit::ProgramSource source{.surface = made.surface, .bound = made.bound};
  source.ring_ends = made.ring_ends;
  source.ring_axis = made.ring_axis;
  // The engine extends the box by the thickness of the shell; bounds are used to check what fits a
  // display.
  const bool units = out->record.thickness_unit == gpu::ThicknessUnit::kUnits;
  const double shell = units ? static_cast<double>(out->record.thickness) / 2 : 0;
  out->record.params[6] = 1;
  for (int a = 0; a < 3; ++a) {
    for (const double reach : {made.min[a] - shell, made.max[a] + shell}) {
      if (CheckFloat(path, reach).has_value()) {
        return Fault{path.ToString(), Reason::kOutOfRange,
                     absl::StrCat("reaches to ", Show(reach),
                                  ", beyond what single precision holds; give it a transform")};
      }
    }
    out->min[a] = made.min[a] - shell;
    out->max[a] = made.max[a] + shell;
    out->record.params[a] = static_cast<float>(made.min[a]);
    out->record.params[3 + a] = static_cast<float>(made.max[a]);
  }
  ScaleTable table;
  if (context.scale != nullptr) {
    if (auto fault = ToLevel(context.scale_path, *context.scale, out->min, out->max, graph,
                             &source.color[0], &table)) {
      return fault;
    }
    source.table = table;
  }
  return ToProgram(path, graph, source, made.ring_points, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Arrow& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Arrow arrow;
  if (auto fault = ToVector(FieldPath(path, "start"), in.start(), &arrow.start)) return fault;
  if (auto fault = ToVector(FieldPath(path, "end"), in.end(), &arrow.end)) return fault;
  const double length = gpu::implicit::Length(arrow.end - arrow.start);
  if (!(length > 0)) {
    return Fault{FieldPath(path, "end").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", ShowVector(arrow.end), " as start is; give another point")};
  }
  const FieldPath head_length(path, "head_length");
  if (auto fault = CheckNotNegative(FieldPath(path, "shaft_radius"), in.shaft_radius()))
    return fault;
  if (auto fault = CheckNotNegative(head_length, in.head_length())) return fault;
  if (auto fault = CheckNotNegative(FieldPath(path, "head_radius"), in.head_radius())) return fault;
  if (in.head_length() > length * (1 + 1e-6)) {
    return Fault{head_length.ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.head_length()), "; the arrow is ", Show(length),
                              " long: give no more")};
  }
  arrow.shaft_radius = in.shaft_radius();
  arrow.head_length = in.head_length() == 0 ? length / 4 : in.head_length();
  arrow.head_radius = in.head_radius() == 0 ? arrow.head_length * 2 / 5 : in.head_radius();
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, arrow, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, arrow, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Cone& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Cone cone{
      .start_radius = in.start_radius(), .end_radius = in.end_radius(), .round = in.round_ends()};
  if (auto fault = ToVector(FieldPath(path, "start"), in.start(), &cone.start)) return fault;
  if (auto fault = ToVector(FieldPath(path, "end"), in.end(), &cone.end)) return fault;
  const FieldPath start_radius(path, "start_radius"), end_radius(path, "end_radius");
  if (auto fault = CheckNotNegative(start_radius, in.start_radius())) return fault;
  if (auto fault = CheckNotNegative(end_radius, in.end_radius())) return fault;
  if (in.start_radius() == 0 && in.end_radius() == 0) {
    return Fault{start_radius.ToString(), Reason::kInvalidValue,
                 "and end_radius are 0; give one of them greater than 0"};
  }
  if (!(gpu::implicit::Length(cone.end - cone.start) > 0)) {
    return Fault{FieldPath(path, "end").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", ShowVector(cone.end), " as start is; give another point")};
  }
  if (cone.OneHoldsTheOther()) {
    return Fault{end_radius.ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.end_radius()), " beside ", Show(in.start_radius()),
                              ", so that one end's sphere holds the other's; give a sphere")};
  }
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, cone, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, cone, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Disc& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Disc disc{.normal = {0, 0, 1}, .radius = in.radius(), .inner_radius = in.inner_radius()};
  if (auto fault = ToVector(FieldPath(path, "center"), in.center(), &disc.center)) return fault;
  if (in.has_normal()) {
    const FieldPath normal(path, "normal");
    if (auto fault = ToVector(normal, in.normal(), &disc.normal)) return fault;
    if (!(gpu::implicit::Length(disc.normal) > 0)) {
      return Fault{normal.ToString(), Reason::kInvalidValue,
                   absl::StrCat("is ", ShowVector(disc.normal), "; give a direction")};
    }
  }
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  const FieldPath inner(path, "inner_radius");
  if (auto fault = CheckNotNegative(inner, in.inner_radius())) return fault;
  if (in.inner_radius() >= in.radius()) {
    return Fault{inner.ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(in.inner_radius()), "; give less than radius, ",
                              Show(in.radius()))};
  }
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, disc, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, disc, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Ellipsoid& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Ellipsoid ellipsoid;
  if (auto fault = ToVector(FieldPath(path, "center"), in.center(), &ellipsoid.center))
    return fault;
  if (auto fault = CheckSize(FieldPath(path, "radii"), in.radii())) return fault;
  ellipsoid.radii = {in.radii().x(), in.radii().y(), in.radii().z()};
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, ellipsoid, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, ellipsoid, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Parallelepiped& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Parallelepiped shape;
  if (auto fault = ToVector(FieldPath(path, "center"), in.center(), &shape.center)) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_a"), in.edge_a(), &shape.edges[0])) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_b"), in.edge_b(), &shape.edges[1])) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_c"), in.edge_c(), &shape.edges[2])) return fault;
  double product = 1;
  for (const Vector& edge : shape.edges) product *= gpu::implicit::Length(edge);
  if (!(shape.volume() > kLeastSine * product)) {
    return Fault{
        FieldPath(path, "edge_c").ToString(), Reason::kInvalidValue,
        absl::StrCat("is ", ShowVector(shape.edges[2]), " beside ", ShowVector(shape.edges[0]),
                     " and ", ShowVector(shape.edges[1]), "; the three edges must span a volume")};
  }
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, shape, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, shape, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Patch& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Patch patch;
  if (auto fault = ToVector(FieldPath(path, "corner"), in.corner(), &patch.corner)) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_a"), in.edge_a(), &patch.u)) return fault;
  if (auto fault = ToVector(FieldPath(path, "edge_b"), in.edge_b(), &patch.v)) return fault;
  const double product = gpu::implicit::Length(patch.u) * gpu::implicit::Length(patch.v);
  if (!(gpu::implicit::Length(gpu::implicit::Cross(patch.u, patch.v)) > kLeastSine * product)) {
    return Fault{FieldPath(path, "edge_b").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", ShowVector(patch.v), " beside ", ShowVector(patch.u),
                              "; the two edges must span an area")};
  }
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, patch, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, patch, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Polygon& in, const ShapeContext& context,
                   GeometryData* out) {
  std::vector<uint32_t> ends;
  if (auto fault = ToRings(path, in.points(), in.ends(), context.context, &ends)) return fault;
  std::vector<Vector> points;
  for (int i = 0; i + 2 < in.points_size(); i += 3) {
    points.push_back({in.points(i), in.points(i + 1), in.points(i + 2)});
  }
  const gpu::Polygon polygon{points, ends};
  const Vector normal = polygon.Normal();
  double extent = 0;
  for (const Vector& p : points) extent = std::max(extent, gpu::implicit::Length(p - points[0]));
  const FieldPath at(path, "points");
  if (!(gpu::implicit::Length(normal) > kLeastSine * extent * extent)) {
    return Fault{at.ToString(), Reason::kInvalidValue,
                 "lie along one line; give curves that have an area"};
  }
  constexpr double kMostUneven = 1e-3;
  if (const double uneven = polygon.Unevenness(normal); uneven > kMostUneven * extent) {
    return Fault{at.ToString(), Reason::kInvalidValue,
                 absl::StrCat("are ", Show(uneven), " away from a plane; give points within ",
                              Show(kMostUneven * extent), ", or a mesh")};
  }
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, polygon, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, polygon, out);
}

MaybeFault ToShape(const FieldPath& path, const v1::Torus& in, const ShapeContext& context,
                   GeometryData* out) {
  gpu::Torus torus{.radius = in.radius(), .tube_radius = in.tube_radius()};
  if (auto fault = ToVector(FieldPath(path, "center"), in.center(), &torus.center)) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "tube_radius"), in.tube_radius())) return fault;
  bool done;
  if (auto fault = ToLookOrFrame(path, in, context, torus, out, &done)) return fault;
  return done ? MaybeFault() : FinishShape(path, context, torus, out);
}

}  // namespace voxeld::daemon::wire
