#include "daemon/wire/primitive.h"

#include <cmath>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/basic_shapes.h"
#include "daemon/wire/color_scale.h"
#include "daemon/wire/curves.h"
#include "daemon/wire/encode_primitive.h"
#include "daemon/wire/fields.h"
#include "daemon/wire/grids.h"
#include "daemon/wire/height_map.h"
#include "daemon/wire/implicit.h"
#include "daemon/wire/named_ranges.h"
#include "daemon/wire/open_edges.h"
#include "daemon/wire/shapes.h"
#include "daemon/wire/text.h"
#include "daemon/wire/texture.h"
#include "daemon/wire/vertices.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr uint32_t kGreatestColor = 0xFFFFFF;
constexpr uint32_t kWhite = 0xFFFFFF;

MaybeFault ToPoints(const FieldPath& path, const v1::Points& in, const DecodeContext& context,
                    GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kPoints;
  if (auto fault =
          ToThickness(FieldPath(path, "thickness"), in.thickness(), context, &out->record)) {
    return fault;
  }
  switch (in.splat()) {
    case v1::Points::SPLAT_UNSPECIFIED:
    case v1::Points::BALL:
      break;
    case v1::Points::SOFT:
      out->record.splat = gpu::Splat::kSoft;
      break;
    case v1::Points::CUBE:
      out->record.splat = gpu::Splat::kCube;
      break;
    case v1::Points::CELL:
      if (out->record.thickness != 0) {
        return Fault{FieldPath(path, "thickness").ToString(), Reason::kOutOfRange,
                     absl::StrCat("is ", Show(in.thickness().value()),
                                  "; cells have none: each is 1 unit wide")};
      }
      out->record.splat = gpu::Splat::kCell;
      break;
    default:
      return UnknownEnum(FieldPath(path, "splat"), in.splat(), "BALL, SOFT, CUBE, CELL");
  }
  return ToVertices(FieldPath(path, "vertices"), in.vertices(), false, context, out);
}

// Returns: the number of corners: indices, or consecutive vertices.
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
  if (auto fault = ToSampling(path, in.sampling(), &record)) return fault;
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
  return ToElementColors(FieldPath(path, "vertices"), in.vertices(), context, out);
}

// An open mesh is drawn as its surface.
MaybeFault FillMesh(const FieldPath& path, const DecodeContext& context, GeometryData* out) {
  out->record.fill = gpu::Fill::kSurface;
  const FieldPath fill(path, "fill");
  if (out->record.color_mode != gpu::ColorMode::kUniform) {
    return Fault{fill.ToString(), Reason::kInvalidValue,
                 "is FILL_SOLID, which has one colour, but vertices have theirs; leave these out, "
                 "and draw the surface in them as another entity"};
  }
  const std::optional<OpenEdge> open = FindOpenEdge(out->arrays.positions(), out->arrays.indices());
  if (!open) {
    out->record.kind = gpu::PrimitiveKind::kFilled;
    return {};
  }
  if (context.notes != nullptr) {
    context.notes->push_back(
        {fill.ToString(), Reason::kInvalidValue,
         absl::StrCat("is FILL_SOLID, but the mesh is open: the edge of vertices ", open->first,
                      " and ", open->second, " belongs to ", open->triangles,
                      open->triangles == 1 ? " triangle" : " triangles",
                      ", and it takes an even number; its surface is drawn")});
  }
  return {};
}

MaybeFault ToMesh(const FieldPath& path, const v1::Mesh& in, const DecodeContext& context,
                  GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kTriangles;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  bool framed;
  if (auto fault = ToFill(path, in.fill(), &out->record, &framed)) return fault;
  const bool surface = !framed && out->record.fill == gpu::Fill::kSurface;
  if (auto fault = ToShell(path, in.shell(), surface, context, &out->record)) return fault;
  if (in.has_texture() && !surface) {
    return Fault{FieldPath(path, "texture").ToString(), Reason::kInvalidValue,
                 "is given, but only a surface takes one; leave it out, or fill"};
  }
  if (auto fault = ToVertices(FieldPath(path, "vertices"), in.vertices(), true, context, out)) {
    return fault;
  }
  if (Corners(out->record) % 3 != 0) {
    return BadCorners(path, out->record, "triangles take three corners each: a multiple of 3");
  }
  const FieldPath vertices(path, "vertices");
  if (in.has_texture() && in.vertices().colors_of() == v1::Vertices::ELEMENTS) {
    return Fault{FieldPath(vertices, "colors_of").ToString(), Reason::kInvalidValue,
                 "is ELEMENTS, but a texture lies on vertices; give VERTICES"};
  }
  if (auto fault = ToElementColors(vertices, in.vertices(), context, out)) return fault;
  return out->record.fill == gpu::Fill::kSolid ? FillMesh(path, context, out) : MaybeFault();
}

MaybeFault ToRgb(const FieldPath& path, const v1::Color& in, uint32_t* out) {
  if (in.rgb() > kGreatestColor) {
    return Fault{FieldPath(path, "rgb").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is 0x", absl::Hex(in.rgb()), "; give 0xRRGGBB, at most 0xffffff")};
  }
  *out = in.rgb();
  return {};
}

MaybeFault ToInstance(const FieldPath& path, const v1::Primitive& in, const Limits& limits,
                      Content* out) {
  if (in.has_color()) {
    return Unimplemented(FieldPath(path, "color"),
                         "an instance takes the colours of its object; leave it unset");
  }
  if (in.has_color_scale()) {
    return Unimplemented(FieldPath(path, "color_scale"),
                         "an instance takes the colours of its object; leave it unset");
  }
  const FieldPath instance(path, "instance");
  const FieldPath object(instance, "object");
  if (auto fault = CheckName(object, in.instance().object(), limits.max_id_bytes)) return fault;
  InstanceRef ref{in.instance().object()};
  if (in.instance().has_tint()) {
    if (auto fault = ToRgb(FieldPath(instance, "tint"), in.instance().tint(), &ref.tint)) {
      return fault;
    }
  }
  *out = std::move(ref);
  return {};
}

MaybeFault ToGeometry(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                      GeometryData* out) {
  const FieldPath scale(path, "color_scale");
  const ShapeContext shape{context, scale, in.has_color_scale() ? &in.color_scale() : nullptr};
  switch (in.kind_case()) {
    case v1::Primitive::kPoints:
      return ToPoints(FieldPath(path, "points"), in.points(), context, out);
    case v1::Primitive::kSegments:
      return ToSegments(FieldPath(path, "segments"), in.segments(), context, out);
    case v1::Primitive::kMesh:
      return ToMesh(FieldPath(path, "mesh"), in.mesh(), context, out);
    case v1::Primitive::kBox:
      return ToBox(FieldPath(path, "box"), in.box(), shape, out);
    case v1::Primitive::kSphere:
      return ToSphere(FieldPath(path, "sphere"), in.sphere(), shape, out);
    case v1::Primitive::kCylinder:
      return ToCylinder(FieldPath(path, "cylinder"), in.cylinder(), shape, out);
    case v1::Primitive::kImplicit:
      return ToImplicit(FieldPath(path, "implicit"), in.implicit(), context, out);
    case v1::Primitive::kEllipsoid:
      return ToShape(FieldPath(path, "ellipsoid"), in.ellipsoid(), shape, out);
    case v1::Primitive::kTorus:
      return ToShape(FieldPath(path, "torus"), in.torus(), shape, out);
    case v1::Primitive::kCone:
      return ToShape(FieldPath(path, "cone"), in.cone(), shape, out);
    case v1::Primitive::kParallelepiped:
      return ToShape(FieldPath(path, "parallelepiped"), in.parallelepiped(), shape, out);
    case v1::Primitive::kDisc:
      return ToShape(FieldPath(path, "disc"), in.disc(), shape, out);
    case v1::Primitive::kPatch:
      return ToShape(FieldPath(path, "patch"), in.patch(), shape, out);
    case v1::Primitive::kPolygon:
      return ToShape(FieldPath(path, "polygon"), in.polygon(), shape, out);
    case v1::Primitive::kHeightMap:
      return ToHeightMap(FieldPath(path, "height_map"), in.height_map(), context, out);
    case v1::Primitive::kCurve:
      return ReadCurve(FieldPath(path, "curve"), in.curve(), context, out);
    case v1::Primitive::kArc:
      return ToArc(FieldPath(path, "arc"), in.arc(), context, out);
    case v1::Primitive::kEllipse:
      return ToEllipse(FieldPath(path, "ellipse"), in.ellipse(), context, out);
    case v1::Primitive::kHelix:
      return ToHelix(FieldPath(path, "helix"), in.helix(), context, out);
    case v1::Primitive::kBezierSurface:
      return ReadBezierSurface(FieldPath(path, "bezier_surface"), in.bezier_surface(), context,
                               out);
    case v1::Primitive::kArrow:
      return ToShape(FieldPath(path, "arrow"), in.arrow(), shape, out);
    case v1::Primitive::kVolume:  // groups, which were handled earlier
    case v1::Primitive::kIsosurface:
    case v1::Primitive::kText:      // several geometries; handled earlier
    case v1::Primitive::kInstance:  // not a geometry; handled earlier
    case v1::Primitive::KIND_NOT_SET:
      break;
  }
  return Fault{FieldPath(path, "kind").ToString(), Reason::kInvalidValue,
               "is not set, or not known to this version of the server; give one of points, "
               "segments, mesh, box, sphere, cylinder, instance, implicit, ellipsoid, torus, cone, "
               "parallelepiped, disc, patch, polygon, height_map, curve, arc, ellipse, helix, "
               "bezier_surface, arrow, text, volume, isosurface"};
}

// Returns: whether record and arrays do not represent what was sent.
bool IsKeptAsSent(const v1::Primitive& in, const GeometryData& data) {
  switch (in.kind_case()) {
    case v1::Primitive::kPoints:
    case v1::Primitive::kSegments:
      return false;
    case v1::Primitive::kMesh:
      return (data.record.kind != gpu::PrimitiveKind::kTriangles &&
              data.record.kind != gpu::PrimitiveKind::kFilled) ||
             data.record.texture_width != 0;
    case v1::Primitive::kBox:
    case v1::Primitive::kSphere:
    case v1::Primitive::kCylinder:
      return data.record.vertex_count != 0 ||  // as lines or dots
             data.record.kind == gpu::PrimitiveKind::kImplicit;
    default:
      return true;
  }
}

// Returns: whether the vertices are converted after they have been read.
bool IsConverted(const v1::Primitive& in) {
  return in.has_curve() || in.has_bezier_surface() ||
         (in.has_mesh() && (in.mesh().has_texture() || in.mesh().fill() == v1::FILL_LINES ||
                            in.mesh().fill() == v1::FILL_DOTS));
}

// Returns: a primitive that has been read, with its arrays in the message.
std::string AsRead(const v1::Primitive& in, const GeometryData& data) {
  v1::Primitive sent = in;
  v1::Vertices* const vertices = sent.has_curve() ? sent.mutable_curve()->mutable_vertices()
                                 : sent.has_mesh()
                                     ? sent.mutable_mesh()->mutable_vertices()
                                     : sent.mutable_bezier_surface()->mutable_vertices();
  vertices->Clear();
  VerticesToWire(data, vertices);
  return sent.SerializeAsString();
}

MaybeFault Convert(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                   GeometryData* out) {
  if (in.has_curve()) return ToSpline(FieldPath(path, "curve"), in.curve(), context, out);
  if (in.has_bezier_surface()) {
    return ToPatches(FieldPath(path, "bezier_surface"), in.bezier_surface(), context, out);
  }
  const FieldPath mesh(path, "mesh");
  if (in.mesh().has_texture()) {
    return ToTexture(FieldPath(mesh, "texture"), in.mesh().texture(), context, out);
  }
  return ToMeshFrame(mesh, in.mesh().fill() == v1::FILL_DOTS, context, out);
}

MaybeFault ToColors(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                    GeometryData* out) {
  const FieldPath scale(path, "color_scale");
  const bool implicit = out != nullptr && out->record.kind == gpu::PrimitiveKind::kImplicit;
  switch (in.kind_case()) {
    case v1::Primitive::kPoints:
    case v1::Primitive::kSegments:
    case v1::Primitive::kMesh:
    case v1::Primitive::kCurve:
    case v1::Primitive::kBezierSurface:
    case v1::Primitive::kHeightMap:
      if (in.has_mesh() && in.mesh().fill() == v1::FILL_SOLID) {
        return Fault{scale.ToString(), Reason::kInvalidValue,
                     "is given for a mesh that is FILL_SOLID, which has one colour; leave it out, "
                     "and draw the surface in colours as another entity"};
      }
      return ToVertexColors(scale, in.color_scale(), context, out);
    case v1::Primitive::kImplicit:
    case v1::Primitive::kVolume:
      break;
    default:
      if (implicit) return {};  // its program includes the colours
      if (!in.color_scale().scalars().empty()) {
        return Fault{FieldPath(scale, "scalars").ToString(), Reason::kInvalidValue,
                     "is given, but the shape has no vertices; give along"};
      }
      return ToVertexColors(scale, in.color_scale(), context, out);
  }
  return Fault{
      scale.ToString(), Reason::kInvalidValue,
      absl::StrCat("is given, but ", in.GetDescriptor()->FindFieldByNumber(in.kind_case())->name(),
                   " takes none; leave it out")};
}

MaybeFault ToSamples(const FieldPath& path, const v1::Primitive& in, uint32_t color,
                     const DecodeContext& context, Content* out) {
  auto group = std::make_shared<GroupData>();
  const FieldPath volume(path, "volume"), isosurface(path, "isosurface"),
      scale(path, "color_scale");
  const ShapeContext shape{context, scale, in.has_color_scale() ? &in.color_scale() : nullptr};
  if (auto fault = in.has_volume()
                       ? ToVolume(volume, in.volume(), color, context, group.get())
                       : ToIsosurface(isosurface, in.isosurface(), color, shape, group.get())) {
    return fault;
  }
  group->kind = in.has_volume() ? "volume" : "isosurface";
  group->as_sent = in.SerializeAsString();
  *out = GroupPtr(std::move(group));
  return {};
}

MaybeFault ToWhatItIs(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                      Content* out) {
  if (in.kind_case() == v1::Primitive::kInstance) return ToInstance(path, in, context, out);
  uint32_t color = kWhite;
  if (in.has_color()) {
    if (auto fault = ToRgb(FieldPath(path, "color"), in.color(), &color)) return fault;
  }
  if (in.has_text() || in.has_volume() || in.has_isosurface()) {
    if (in.has_color_scale() && in.has_volume()) return ToColors(path, in, context, nullptr);
    if (in.has_text()) return ToText(path, in, color, context, out);
    return ToSamples(path, in, color, context, out);
  }
  auto data = std::make_shared<GeometryData>();
  data->record.color = color;
  if (auto fault = ToGeometry(path, in, context, data.get())) return fault;
  const bool converted = IsConverted(in);
  if (converted) data->as_sent = AsRead(in, *data);
  if (in.has_color_scale()) {
    if (auto fault = ToColors(path, in, context, data.get())) return fault;
  }
  if (in.has_height_map()) {
    if (auto fault = AddHeightMapPicture(FieldPath(path, "height_map"), in.height_map(), context,
                                         data.get())) {
      return fault;
    }
  }
  if (converted) {
    if (auto fault = Convert(path, in, context, data.get())) return fault;
  }
  if (gpu::IsCurved(data->record.kind)) {
    data->need = gpu::CutNeed::Of(data->record, data->arrays.positions());
  }
  if (IsKeptAsSent(in, *data)) {
    data->kind = in.GetDescriptor()->FindFieldByNumber(in.kind_case())->name().c_str();
    if (!converted) data->as_sent = in.SerializeAsString();
  }
  *out = GeometryPtr(std::move(data));
  return {};
}

// Returns: the memory of content that may exceed its message: converted primitives, and elements
// with colours, which get separate vertices.
uint64_t MadeBytes(const v1::Primitive& in, const Content& content) {
  if (const auto* group = std::get_if<GroupPtr>(&content)) return (*group)->bytes();
  const auto* geometry = std::get_if<GeometryPtr>(&content);
  const bool made =
      geometry != nullptr && ((*geometry)->kind != nullptr ||
                              in.segments().vertices().colors_of() == v1::Vertices::ELEMENTS ||
                              in.mesh().vertices().colors_of() == v1::Vertices::ELEMENTS);
  return made ? (*geometry)->bytes() : 0;
}

}  // namespace

MaybeFault ToContent(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                     Content* out) {
  const uint64_t most = context.limits.max_uncommitted_bytes;
  const bool counted = context.decoded_bytes != nullptr;
  if (counted && *context.decoded_bytes > most) {
    return Fault{path.ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("comes after primitives that take ", *context.decoded_bytes,
                              " bytes; max_uncommitted_bytes is ", most, ": commit less at once")};
  }
  if (NamesMore(in)) {
    v1::Primitive whole;
    if (auto fault = PutInPlace(path, in, context, &whole)) return fault;
    return ToContent(path, whole, context, out);
  }
  if (auto fault = ToWhatItIs(path, in, context, out)) return fault;
  if (counted) *context.decoded_bytes += MadeBytes(in, *out);
  return {};
}

}  // namespace voxeld::daemon::wire
