#include "daemon/wire/primitive.h"

#include <cmath>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/height_map.h"
#include "daemon/wire/implicit.h"
#include "daemon/wire/shapes.h"
#include "daemon/wire/vertices.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr uint32_t kGreatestColor = 0xFFFFFF;

MaybeFault ToPoints(const FieldPath& path, const v1::Points& in, const DecodeContext& context,
                    GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kPoints;
  if (auto fault =
          ToThickness(FieldPath(path, "thickness"), in.thickness(), context, &out->record)) {
    return fault;
  }
  return ToVertices(FieldPath(path, "vertices"), in.vertices(), false, context, out);
}

// How many corners the primitive has: its indices, or its vertices as they stand.
uint32_t Corners(const gpu::GeometryRecord& record) {
  return record.index_count != 0 ? record.index_count : record.vertex_count;
}

Fault BadCorners(const FieldPath& path, const gpu::GeometryRecord& record, const char* right) {
  const FieldPath vertices(path, "vertices");
  return {FieldPath(vertices, record.index_count != 0 ? "index_count" : "count").ToString(),
          Reason::kSizeMismatch, absl::StrCat("is ", Corners(record), "; ", right)};
}

MaybeFault ToSegments(const FieldPath& path, const v1::Segments& in, const DecodeContext& context,
                      GeometryData* out) {
  gpu::GeometryRecord& record = out->record;
  record.kind = gpu::PrimitiveKind::kSegments;
  switch (in.topology()) {
    case v1::Segments::TOPOLOGY_UNSPECIFIED:
    case v1::Segments::LIST:
      record.topology = gpu::Topology::kList;
      break;
    case v1::Segments::STRIP:
      record.topology = gpu::Topology::kStrip;
      break;
    case v1::Segments::LOOP:
      record.topology = gpu::Topology::kLoop;
      break;
    default:
      return UnknownEnum(FieldPath(path, "topology"), in.topology(), "LIST, STRIP, LOOP");
  }
  switch (in.sampling()) {
    case v1::LINE_SAMPLING_UNSPECIFIED:
    case v1::LINE_SAMPLING_THIN:
      record.sampling = gpu::LineSampling::kThin;
      break;
    case v1::LINE_SAMPLING_EUCLIDEAN:
      record.sampling = gpu::LineSampling::kEuclidean;
      break;
    case v1::LINE_SAMPLING_COVER:
      record.sampling = gpu::LineSampling::kCover;
      break;
    default:
      return UnknownEnum(FieldPath(path, "sampling"), in.sampling(),
                         "LINE_SAMPLING_THIN, LINE_SAMPLING_EUCLIDEAN, LINE_SAMPLING_COVER");
  }
  if (auto fault = ToThickness(FieldPath(path, "thickness"), in.thickness(), context, &record)) {
    return fault;
  }
  if (auto fault = ToVertices(FieldPath(path, "vertices"), in.vertices(), true, context, out)) {
    return fault;
  }
  if (record.topology == gpu::Topology::kList && Corners(record) % 2 != 0) {
    return BadCorners(path, record, "a LIST of segments takes two corners each: an even number");
  }
  if (Corners(record) < 2) return BadCorners(path, record, "give at least 2 corners");
  return {};
}

MaybeFault ToMesh(const FieldPath& path, const v1::Mesh& in, const DecodeContext& context,
                  GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kTriangles;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  if (auto fault = ToVertices(FieldPath(path, "vertices"), in.vertices(), true, context, out)) {
    return fault;
  }
  if (Corners(out->record) % 3 != 0) {
    return BadCorners(path, out->record, "triangles take three corners each: a multiple of 3");
  }
  return {};
}

// Writes centre and bounds: `half` is how far the shape reaches from its centre along each axis.
void SetExtent(const v1::Vec3& center, const double (&half)[3], GeometryData* out) {
  const double middle[3] = {center.x(), center.y(), center.z()};
  for (int axis = 0; axis < 3; ++axis) {
    out->record.params[axis] = static_cast<float>(middle[axis]);
    out->min[axis] = double{out->record.params[axis]} - half[axis];
    out->max[axis] = double{out->record.params[axis]} + half[axis];
  }
}

MaybeFault ToBox(const FieldPath& path, const v1::Box& in, GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kBox;
  if (auto fault = CheckVec3(FieldPath(path, "center"), in.center())) return fault;
  if (auto fault = CheckSize(FieldPath(path, "size"), in.size())) return fault;
  if (auto fault = ToFill(path, in.fill(), &out->record)) return fault;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  const double size[3] = {in.size().x(), in.size().y(), in.size().z()};
  double half[3];
  for (int axis = 0; axis < 3; ++axis) {
    out->record.params[3 + axis] = static_cast<float>(size[axis]);
    half[axis] = double{out->record.params[3 + axis]} / 2;
  }
  SetExtent(in.center(), half, out);
  return {};
}

MaybeFault ToSphere(const FieldPath& path, const v1::Sphere& in, GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kSphere;
  if (auto fault = CheckVec3(FieldPath(path, "center"), in.center())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  if (auto fault = ToFill(path, in.fill(), &out->record)) return fault;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  const float radius = static_cast<float>(in.radius());
  out->record.params[3] = radius;
  SetExtent(in.center(), {radius, radius, radius}, out);
  return {};
}

MaybeFault ToCylinder(const FieldPath& path, const v1::Cylinder& in, GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kCylinder;
  if (auto fault = CheckVec3(FieldPath(path, "center"), in.center())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "height"), in.height())) return fault;
  if (auto fault = ToFill(path, in.fill(), &out->record)) return fault;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  const float radius = static_cast<float>(in.radius());
  const float height = static_cast<float>(in.height());
  out->record.params[3] = radius;
  out->record.params[4] = height;
  SetExtent(in.center(), {radius, radius, double{height} / 2}, out);
  return {};
}

MaybeFault ToInstance(const FieldPath& path, const v1::Primitive& in, const Limits& limits,
                      Content* out) {
  if (in.has_color()) {
    return Unimplemented(FieldPath(path, "color"),
                         "an instance takes the colours of its object; leave it unset");
  }
  const FieldPath instance(path, "instance");
  const FieldPath object(instance, "object");
  if (auto fault = CheckName(object, in.instance().object(), limits.max_id_bytes)) return fault;
  *out = InstanceRef{in.instance().object()};
  return {};
}

MaybeFault ToGeometry(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                      GeometryData* out) {
  switch (in.kind_case()) {
    case v1::Primitive::kPoints:
      return ToPoints(FieldPath(path, "points"), in.points(), context, out);
    case v1::Primitive::kSegments:
      return ToSegments(FieldPath(path, "segments"), in.segments(), context, out);
    case v1::Primitive::kMesh:
      return ToMesh(FieldPath(path, "mesh"), in.mesh(), context, out);
    case v1::Primitive::kBox:
      return ToBox(FieldPath(path, "box"), in.box(), out);
    case v1::Primitive::kSphere:
      return ToSphere(FieldPath(path, "sphere"), in.sphere(), out);
    case v1::Primitive::kCylinder:
      return ToCylinder(FieldPath(path, "cylinder"), in.cylinder(), out);
    case v1::Primitive::kImplicit:
      return ToImplicit(FieldPath(path, "implicit"), in.implicit(), context, out);
    case v1::Primitive::kEllipsoid:
      return ToShape(FieldPath(path, "ellipsoid"), in.ellipsoid(), context, out);
    case v1::Primitive::kTorus:
      return ToShape(FieldPath(path, "torus"), in.torus(), context, out);
    case v1::Primitive::kCone:
      return ToShape(FieldPath(path, "cone"), in.cone(), context, out);
    case v1::Primitive::kParallelepiped:
      return ToShape(FieldPath(path, "parallelepiped"), in.parallelepiped(), context, out);
    case v1::Primitive::kDisc:
      return ToShape(FieldPath(path, "disc"), in.disc(), context, out);
    case v1::Primitive::kPatch:
      return ToShape(FieldPath(path, "patch"), in.patch(), context, out);
    case v1::Primitive::kPolygon:
      return ToShape(FieldPath(path, "polygon"), in.polygon(), context, out);
    case v1::Primitive::kHeightMap:
      return ToHeightMap(FieldPath(path, "height_map"), in.height_map(), context, out);
    case v1::Primitive::kInstance:  // is no geometry, and has been dealt with
    case v1::Primitive::KIND_NOT_SET:
      break;
  }
  return Fault{FieldPath(path, "kind").ToString(), Reason::kInvalidValue,
               "is not set, or not known to this version of the server; give one of points, "
               "segments, mesh, box, sphere, cylinder, instance, implicit, ellipsoid, torus, cone, "
               "parallelepiped, disc, patch, polygon, height_map"};
}

// Whether record and arrays do not say what was sent.
bool IsKeptAsSent(const v1::Primitive& in) {
  switch (in.kind_case()) {
    case v1::Primitive::kPoints:
    case v1::Primitive::kSegments:
    case v1::Primitive::kMesh:
    case v1::Primitive::kBox:
    case v1::Primitive::kSphere:
    case v1::Primitive::kCylinder:
      return false;
    default:
      return true;
  }
}

}  // namespace

MaybeFault ToContent(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                     Content* out) {
  if (in.kind_case() == v1::Primitive::kInstance) return ToInstance(path, in, context, out);
  auto data = std::make_shared<GeometryData>();
  if (in.has_color()) {
    if (in.color().rgb() > kGreatestColor) {
      const FieldPath color(path, "color");
      return Fault{
          FieldPath(color, "rgb").ToString(), Reason::kInvalidValue,
          absl::StrCat("is 0x", absl::Hex(in.color().rgb()), "; give 0xRRGGBB, at most 0xffffff")};
    }
    data->record.color = in.color().rgb();
  }
  if (auto fault = ToGeometry(path, in, context, data.get())) return fault;
  if (IsKeptAsSent(in)) {
    data->kind = in.GetDescriptor()->FindFieldByNumber(in.kind_case())->name().c_str();
    data->as_sent = in.SerializeAsString();
  }
  *out = GeometryPtr(std::move(data));
  return {};
}

}  // namespace voxeld::daemon::wire
