#include "client/cpp/src/encode_shapes.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::client {
namespace {

void Set(const Vec3& from, v1::Vec3* to) {
  to->set_x(from.x);
  to->set_y(from.y);
  to->set_z(from.z);
}

// The wire's enumerations begin with UNSPECIFIED and then match ours.
template <typename Wire, typename Ours>
Wire Word(Ours value) {
  return static_cast<Wire>(static_cast<int>(value) + 1);
}

v1::Fill WireFill(Fill fill) { return Word<v1::Fill>(fill); }

void Set(const Thickness& from, v1::Thickness* to) {
  to->set_value(from.value);
  to->set_unit(Word<v1::Thickness::Unit>(from.unit));
}

// Sets a line's sampling and thickness.
template <typename Line, typename Message>
void SetLine(const Line& from, Message* to) {
  to->set_sampling(Word<v1::LineSampling>(from.sampling));
  if (from.thickness.value != 0) Set(from.thickness, to->mutable_thickness());
}

// Sets rule and shell, and the fill of shapes that have an inside.
template <typename Shape, typename Message>
void SetLook(const Shape& from, Message* to) {
  if constexpr (requires { to->set_fill(WireFill(from.fill)); }) to->set_fill(WireFill(from.fill));
  to->set_rule(Word<v1::SurfaceRule>(from.rule));
  if (from.shell.value != 0) Set(from.shell, to->mutable_shell());
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

bool IsName(const std::string& name) {
  return !name.empty() && !absl::ascii_isdigit(static_cast<unsigned char>(name[0])) &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return absl::ascii_isalnum(c) || c == '_'; });
}

absl::Status CheckName(const std::string& name) {
  if (IsName(name)) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("a parameter is called \"", absl::CHexEscape(name),
                   "\"; letters, digits and _ make a name, a digit not first"));
}

static_assert(static_cast<int>(expressions::Op::kConstant) == v1::Expression::Tree::CONSTANT &&
              static_cast<int>(expressions::Op::kAdd) == v1::Expression::Tree::ADD &&
              static_cast<int>(expressions::Op::kSmoothMax) == v1::Expression::Tree::SMOOTH_MAX);

absl::Status Set(const Expression& from, v1::Expression* to) {
  if (from.text() != nullptr) to->set_text(*from.text());
  if (from.term() == nullptr) return absl::OkStatus();
  v1::Expression::Tree* const tree = to->mutable_tree();
  for (const expressions::Op op : from.term()->ops()) {
    tree->add_ops(static_cast<v1::Expression::Tree::Op>(op));
  }
  for (const double value : from.term()->values()) {
    if (!std::isfinite(value)) {
      return absl::InvalidArgumentError(
          absl::StrCat("a number in an expression is ", value, "; it must be finite"));
    }
    tree->add_values(value);
  }
  for (const std::string& name : from.term()->names()) {
    if (absl::Status status = CheckName(name); !status.ok()) return status;
    absl::StrAppend(tree->mutable_names(), tree->names().empty() ? "" : " ", name);
  }
  return absl::OkStatus();
}

}  // namespace

uint32_t RgbOf(const Color& color) {
  return static_cast<uint32_t>(color.r) << 16 | static_cast<uint32_t>(color.g) << 8 | color.b;
}

absl::StatusOr<std::string> EncodeShape(const Implicit& shape) {
  v1::Primitive primitive;
  v1::Implicit* const to = primitive.mutable_implicit();
  absl::Status status = Set(shape.surface, to->mutable_surface());
  const auto set = [&](const Expression& from, v1::Expression* (v1::Implicit::*into)()) {
    if (!from.empty()) status.Update(Set(from, (to->*into)()));
  };
  set(shape.bound, &v1::Implicit::mutable_bound);
  set(shape.red, &v1::Implicit::mutable_red);
  set(shape.green, &v1::Implicit::mutable_green);
  set(shape.blue, &v1::Implicit::mutable_blue);
  set(shape.level, &v1::Implicit::mutable_level);
  if (!shape.boundary.empty()) {
    SetCurves(shape.boundary, to->mutable_boundary());
    to->mutable_boundary()->set_axis(shape.boundary_axis == Implicit::Axis::kX   ? v1::Boundary::X
                                     : shape.boundary_axis == Implicit::Axis::kY ? v1::Boundary::Y
                                                                                 : v1::Boundary::Z);
    to->mutable_boundary()->set_form(
        static_cast<v1::Boundary::Form>(static_cast<int>(shape.boundary_form) + 1));
  }
  for (const auto& [name, value] : shape.parameters) {
    status.Update(CheckName(name));
    absl::StrAppend(to->mutable_parameter_names(), to->parameter_names().empty() ? "" : " ", name);
    to->add_parameter_values(value);
  }
  SetLook(shape, to);
  if (shape.fill.has_value()) to->set_fill(WireFill(*shape.fill));
  if (shape.domain.has_value() && !shape.domain->everything) {
    Set(shape.domain->min, to->mutable_domain()->mutable_min());
    Set(shape.domain->max, to->mutable_domain()->mutable_max());
  }
  to->set_colormap(shape.colormap);
  if (!status.ok()) return status;
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

absl::StatusOr<std::string> EncodeShape(const Arrow& shape) {
  v1::Primitive primitive;
  v1::Arrow* const to = primitive.mutable_arrow();
  Set(shape.start, to->mutable_start());
  Set(shape.end, to->mutable_end());
  to->set_shaft_radius(shape.shaft_radius);
  to->set_head_length(shape.head_length);
  to->set_head_radius(shape.head_radius);
  SetLook(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Arc& shape) {
  v1::Primitive primitive;
  v1::Arc* const to = primitive.mutable_arc();
  Set(shape.center, to->mutable_center());
  Set(shape.normal, to->mutable_normal());
  to->set_radius(shape.radius);
  if (shape.toward.has_value()) Set(*shape.toward, to->mutable_toward());
  to->set_start(shape.start);
  to->set_sweep(shape.sweep);
  SetLine(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Ellipse& shape) {
  v1::Primitive primitive;
  v1::Ellipse* const to = primitive.mutable_ellipse();
  Set(shape.center, to->mutable_center());
  Set(shape.axis_a, to->mutable_axis_a());
  Set(shape.axis_b, to->mutable_axis_b());
  to->set_start(shape.start);
  to->set_sweep(shape.sweep);
  SetLine(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Helix& shape) {
  v1::Primitive primitive;
  v1::Helix* const to = primitive.mutable_helix();
  Set(shape.start, to->mutable_start());
  Set(shape.end, to->mutable_end());
  to->set_radius(shape.radius);
  if (shape.end_radius.has_value()) to->set_end_radius(*shape.end_radius);
  to->set_turns(shape.turns);
  if (shape.toward.has_value()) Set(*shape.toward, to->mutable_toward());
  SetLine(shape, to);
  return primitive.SerializeAsString();
}

absl::StatusOr<std::string> EncodeShape(const Text& shape) {
  v1::Primitive primitive;
  v1::Text* const to = primitive.mutable_text();
  to->set_text(shape.text);
  to->set_height(shape.height);
  Set(shape.position, to->mutable_position());
  Set(shape.facing, to->mutable_facing());
  if (shape.up.has_value()) Set(*shape.up, to->mutable_up());
  to->set_style(Word<v1::Text::Style>(shape.style));
  to->set_alignment(Word<v1::Text::Alignment>(shape.alignment));
  to->set_line_spacing(shape.line_spacing);
  to->set_width(shape.width);
  to->set_font(shape.font);
  to->set_depth(shape.depth);
  to->set_rule(Word<v1::SurfaceRule>(shape.rule));
  if (shape.thickness.value != 0) Set(shape.thickness, to->mutable_thickness());
  return primitive.SerializeAsString();
}

std::string EncodeTransfer(const Transfer& transfer) {
  v1::Transfer to;
  to.mutable_values()->Assign(transfer.values.begin(), transfer.values.end());
  for (const Color& color : transfer.colors) to.add_colors(RgbOf(color));
  to.set_colormap(transfer.colormap);
  to.mutable_opacities()->Assign(transfer.opacities.begin(), transfer.opacities.end());
  return to.SerializeAsString();
}

std::string EncodeColorScale(const ColorScale& scale) {
  v1::ColorScale to;
  to.set_colormap(scale.colormap);
  for (const Color& color : scale.colors) to.add_colors(RgbOf(color));
  to.set_low(scale.low);
  to.set_high(scale.high);
  if (scale.along.has_value()) Set(*scale.along, to.mutable_along());
  const std::span<const float> numbers = scale.scalars.view();
  to.set_scalars(reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes());
  return to.SerializeAsString();
}

}  // namespace voxeld::client
