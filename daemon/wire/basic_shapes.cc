#include "daemon/wire/basic_shapes.h"

#include "daemon/wire/fields.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

// Writes centre and bounds. `half` is the extent of the shape from its centre along each axis.
void SetExtent(const v1::Vec3& center, const double (&half)[3], GeometryData* out) {
  const double middle[3] = {center.x(), center.y(), center.z()};
  for (int axis = 0; axis < 3; ++axis) {
    out->record.params[axis] = static_cast<float>(middle[axis]);
    out->min[axis] = double{out->record.params[axis]} - half[axis];
    out->max[axis] = double{out->record.params[axis]} + half[axis];
  }
}

// Returns: whether the record without a program represents the shape completely; otherwise a
// general shape is used.
template <typename Message>
bool IsPlain(const Message& in, const ShapeContext& context) {
  return in.shell().value() == 0 && context.scale == nullptr && in.fill() != v1::FILL_LINES &&
         in.fill() != v1::FILL_DOTS;
}

template <typename Message>
MaybeFault ToLook(const FieldPath& path, const Message& in, const ShapeContext& context,
                  GeometryData* out) {
  bool framed;
  if (auto fault = ToFill(path, in.fill(), &out->record, &framed)) return fault;
  if (auto fault = ToRule(path, in.rule(), &out->record)) return fault;
  return ToShell(path, in.shell(), !framed && out->record.fill == gpu::Fill::kSurface,
                 context.context, &out->record);
}

// Converts the style and the shape itself.
template <typename Message, typename General>
MaybeFault ToGeneral(const FieldPath& path, const Message& in, const ShapeContext& context,
                     General* general, GeometryData* out) {
  general->set_fill(in.fill());
  general->set_rule(in.rule());
  *general->mutable_shell() = in.shell();
  return ToShape(path, *general, context, out);
}

}  // namespace

MaybeFault ToBox(const FieldPath& path, const v1::Box& in, const ShapeContext& context,
                 GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kBox;
  if (auto fault = CheckVec3(FieldPath(path, "center"), in.center())) return fault;
  if (auto fault = CheckSize(FieldPath(path, "size"), in.size())) return fault;
  if (auto fault = ToLook(path, in, context, out)) return fault;
  if (!IsPlain(in, context)) {
    v1::Parallelepiped general;
    *general.mutable_center() = in.center();
    general.mutable_edge_a()->set_x(in.size().x());
    general.mutable_edge_b()->set_y(in.size().y());
    general.mutable_edge_c()->set_z(in.size().z());
    return ToGeneral(path, in, context, &general, out);
  }
  const double size[3] = {in.size().x(), in.size().y(), in.size().z()};
  double half[3];
  for (int axis = 0; axis < 3; ++axis) {
    out->record.params[3 + axis] = static_cast<float>(size[axis]);
    half[axis] = double{out->record.params[3 + axis]} / 2;
  }
  SetExtent(in.center(), half, out);
  return {};
}

MaybeFault ToSphere(const FieldPath& path, const v1::Sphere& in, const ShapeContext& context,
                    GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kSphere;
  if (auto fault = CheckVec3(FieldPath(path, "center"), in.center())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  if (auto fault = ToLook(path, in, context, out)) return fault;
  if (!IsPlain(in, context)) {
    v1::Ellipsoid general;
    *general.mutable_center() = in.center();
    general.mutable_radii()->set_x(in.radius());
    general.mutable_radii()->set_y(in.radius());
    general.mutable_radii()->set_z(in.radius());
    return ToGeneral(path, in, context, &general, out);
  }
  const float radius = static_cast<float>(in.radius());
  out->record.params[3] = radius;
  SetExtent(in.center(), {radius, radius, radius}, out);
  return {};
}

MaybeFault ToCylinder(const FieldPath& path, const v1::Cylinder& in, const ShapeContext& context,
                      GeometryData* out) {
  out->record.kind = gpu::PrimitiveKind::kCylinder;
  if (auto fault = CheckVec3(FieldPath(path, "center"), in.center())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "radius"), in.radius())) return fault;
  if (auto fault = CheckPositive(FieldPath(path, "height"), in.height())) return fault;
  if (auto fault = ToLook(path, in, context, out)) return fault;
  if (!IsPlain(in, context)) {
    v1::Cone general;
    *general.mutable_start() = in.center();
    *general.mutable_end() = in.center();
    general.mutable_start()->set_z(in.center().z() - in.height() / 2);
    general.mutable_end()->set_z(in.center().z() + in.height() / 2);
    general.set_start_radius(in.radius());
    general.set_end_radius(in.radius());
    return ToGeneral(path, in, context, &general, out);
  }
  const float radius = static_cast<float>(in.radius());
  const float height = static_cast<float>(in.height());
  out->record.params[3] = radius;
  out->record.params[4] = height;
  SetExtent(in.center(), {radius, radius, double{height} / 2}, out);
  return {};
}

}  // namespace voxeld::daemon::wire
