#include "client/cpp/src/encode_shapes.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {
namespace {

void Set(const Vec3& from, v1::Vec3* to) {
  to->set_x(from.x);
  to->set_y(from.y);
  to->set_z(from.z);
}

v1::Fill WireFill(Fill fill) { return fill == Fill::kSolid ? v1::FILL_SOLID : v1::FILL_SURFACE; }

// Rule and shell, and the fill of what has an inside.
template <typename Shape, typename Message>
void SetLook(const Shape& from, Message* to) {
  if constexpr (requires { to->set_fill(WireFill(from.fill)); }) to->set_fill(WireFill(from.fill));
  to->set_rule(from.rule == SurfaceRule::kCover ? v1::SURFACE_RULE_COVER : v1::SURFACE_RULE_THIN);
  if (from.shell.value == 0) return;
  to->mutable_shell()->set_value(from.shell.value);
  to->mutable_shell()->set_unit(from.shell.unit == Thickness::Unit::kUnits ? v1::Thickness::UNITS
                                                                           : v1::Thickness::VOXELS);
}

template <typename Message>
void SetCurves(const std::vector<std::vector<Vec3>>& curves, Message* to) {
  uint32_t end = 0;
  for (const std::vector<Vec3>& curve : curves) {
    end += static_cast<uint32_t>(curve.size());
    to->add_ends(end);
    for (const Vec3& p : curve) {
      for (const double number : {p.x, p.y, p.z}) to->add_points(number);
    }
  }
}

void SetText(const std::string& text, v1::Expression* to) { to->set_text(text); }

}  // namespace

absl::StatusOr<std::string> EncodeShape(const Implicit& shape) {
  v1::Primitive primitive;
  v1::Implicit* const to = primitive.mutable_implicit();
  SetText(shape.surface, to->mutable_surface());
  if (!shape.bound.empty()) SetText(shape.bound, to->mutable_bound());
  if (!shape.boundary.empty()) {
    SetCurves(shape.boundary, to->mutable_boundary());
    to->mutable_boundary()->set_axis(shape.boundary_axis == Implicit::Axis::kX   ? v1::Boundary::X
                                     : shape.boundary_axis == Implicit::Axis::kY ? v1::Boundary::Y
                                                                                 : v1::Boundary::Z);
  }
  for (const auto& [name, value] : shape.parameters) {
    if (name.empty() || name.find(' ') != std::string::npos) {
      return absl::InvalidArgumentError(
          absl::StrCat("a parameter is called \"", name, "\"; letters, digits and _ make a name"));
    }
    absl::StrAppend(to->mutable_parameter_names(), to->parameter_names().empty() ? "" : " ", name);
    to->add_parameter_values(value);
  }
  SetLook(shape, to);
  if (shape.fill.has_value()) to->set_fill(WireFill(*shape.fill));
  if (shape.domain.has_value() && !shape.domain->everything) {
    Set(shape.domain->min, to->mutable_domain()->mutable_min());
    Set(shape.domain->max, to->mutable_domain()->mutable_max());
  }
  if (!shape.red.empty()) SetText(shape.red, to->mutable_red());
  if (!shape.green.empty()) SetText(shape.green, to->mutable_green());
  if (!shape.blue.empty()) SetText(shape.blue, to->mutable_blue());
  if (!shape.level.empty()) SetText(shape.level, to->mutable_level());
  to->set_colormap(shape.colormap);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Ellipsoid& shape) {
  v1::Primitive primitive;
  v1::Ellipsoid* const to = primitive.mutable_ellipsoid();
  Set(shape.center, to->mutable_center());
  Set(shape.radii, to->mutable_radii());
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Torus& shape) {
  v1::Primitive primitive;
  v1::Torus* const to = primitive.mutable_torus();
  Set(shape.center, to->mutable_center());
  to->set_radius(shape.radius);
  to->set_tube_radius(shape.tube_radius);
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Cone& shape) {
  v1::Primitive primitive;
  v1::Cone* const to = primitive.mutable_cone();
  Set(shape.start, to->mutable_start());
  Set(shape.end, to->mutable_end());
  to->set_start_radius(shape.start_radius);
  to->set_end_radius(shape.end_radius);
  to->set_round_ends(shape.round_ends);
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Parallelepiped& shape) {
  v1::Primitive primitive;
  v1::Parallelepiped* const to = primitive.mutable_parallelepiped();
  Set(shape.center, to->mutable_center());
  Set(shape.edge_a, to->mutable_edge_a());
  Set(shape.edge_b, to->mutable_edge_b());
  Set(shape.edge_c, to->mutable_edge_c());
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Disc& shape) {
  v1::Primitive primitive;
  v1::Disc* const to = primitive.mutable_disc();
  Set(shape.center, to->mutable_center());
  Set(shape.normal, to->mutable_normal());
  to->set_radius(shape.radius);
  to->set_inner_radius(shape.inner_radius);
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Patch& shape) {
  v1::Primitive primitive;
  v1::Patch* const to = primitive.mutable_patch();
  Set(shape.corner, to->mutable_corner());
  Set(shape.edge_a, to->mutable_edge_a());
  Set(shape.edge_b, to->mutable_edge_b());
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Polygon& shape) {
  v1::Primitive primitive;
  SetCurves(shape.curves, primitive.mutable_polygon());
  SetLook(shape, primitive.mutable_polygon());
  return primitive.SerializeAsString();
}

}  // namespace voxeld::client
