#include "daemon/geometry_wire/geometry_wire.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <variant>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "display/geometry/limits.h"

namespace voxeld::daemon::wire {

void ToWire(const display::Vec3& in, v1::Vec3* out) {
  out->set_x(in.x);
  out->set_y(in.y);
  out->set_z(in.z);
}

display::Vec3 FromWire(const v1::Vec3& in) { return {in.x(), in.y(), in.z()}; }

namespace {

void ShapeToWire(const display::PlanarStack& in, v1::Geometry* geometry) {
  v1::PlanarStack* out = geometry->mutable_planar_stack();
  out->set_normal(in.normal == display::PlanarStack::Normal::kY ? v1::PlanarStack::Y
                                                                : v1::PlanarStack::Z);
  out->set_width_px(in.width_px);
  out->set_height_px(in.height_px);
  out->set_pitch_u_mm(in.pitch_u_mm);
  out->set_pitch_v_mm(in.pitch_v_mm);
  out->mutable_positions_mm()->Assign(in.positions_mm.begin(), in.positions_mm.end());
  out->set_thickness_mm(in.thickness_mm);
  out->set_mirror_u(in.mirror_u);
  out->set_mirror_v(in.mirror_v);
  out->set_strokes(in.strokes);
}

void ShapeToWire(const display::Rotor& in, v1::Geometry* geometry) {
  v1::Rotor* out = geometry->mutable_rotor();
  out->set_slices_per_turn(in.slices_per_turn);
  out->set_width_px(in.width_px);
  out->set_height_px(in.height_px);
  out->set_clockwise(in.clockwise);
  for (const display::Rotor::Panel& panel : in.panels) {
    v1::Rotor::Panel* to = out->add_panels();
    to->set_pitch_u_mm(panel.pitch_u_mm);
    to->set_pitch_v_mm(panel.pitch_v_mm);
    to->set_eccentricity_mm(panel.eccentricity_mm);
    to->set_shift_u_mm(panel.shift_u_mm);
    to->set_shift_v_mm(panel.shift_v_mm);
    to->set_phase_turns(panel.phase_turns);
    to->set_mirror_u(panel.mirror_u);
    to->set_mirror_v(panel.mirror_v);
    to->set_tilt_deg(panel.tilt_deg);
  }
}

void ShapeToWire(const display::Helix& in, v1::Geometry* geometry) {
  v1::HelixScreen* out = geometry->mutable_helix();
  out->set_slices_per_turn(in.slices_per_turn);
  out->set_width_px(in.width_px);
  out->set_height_px(in.height_px);
  out->set_pitch_u_mm(in.pitch_u_mm);
  out->set_pitch_v_mm(in.pitch_v_mm);
  out->set_blades(in.blades);
  out->set_span_turns(in.span_turns);
  out->set_height_mm(in.height_mm);
  out->set_hub_mm(in.hub_mm);
  out->set_radius_mm(in.radius_mm);
  out->set_phase_turns(in.phase_turns);
  out->set_left_handed(in.left_handed);
  out->set_clockwise(in.clockwise);
  out->set_mirror_u(in.mirror_u);
  out->set_mirror_v(in.mirror_v);
}

void CorrectionToWire(const display::Correction& in, v1::Correction* out) {
  out->mutable_affine()->Assign(in.affine.begin(), in.affine.end());
  if (in.displacement.has_value()) {
    v1::Correction::Displacement* const to = out->mutable_displacement();
    to->set_nx(in.displacement->nx);
    to->set_ny(in.displacement->ny);
    to->set_nz(in.displacement->nz);
    ToWire(in.displacement->low_mm, to->mutable_low_mm());
    ToWire(in.displacement->high_mm, to->mutable_high_mm());
    for (const display::Vec3& at : in.displacement->at_mm) {
      for (const double mm : {at.x, at.y, at.z}) to->add_at_mm(mm);
    }
  }
  for (const auto& homography : in.homographies) {
    for (const double m : homography) out->add_homographies(m);
  }
}

void ShapeToWire(const display::Lattice& in, v1::Geometry* geometry) {
  v1::Lattice* out = geometry->mutable_lattice();
  const size_t width = static_cast<size_t>(std::max(1, in.width_px));
  out->set_width_px(in.width_px);
  out->set_slices(static_cast<int32_t>(in.points_mm.size() / width));
  ToWire(in.cell_mm, out->mutable_cell_mm());
  for (size_t pixel = 0; pixel < in.points_mm.size(); ++pixel) {
    if (!in.points_mm[pixel].has_value()) continue;
    out->add_pixels(static_cast<uint32_t>(pixel));
    out->add_x_mm(in.points_mm[pixel]->x);
    out->add_y_mm(in.points_mm[pixel]->y);
    out->add_z_mm(in.points_mm[pixel]->z);
  }
}

absl::StatusOr<display::PlanarStack> ShapeFromWire(const v1::PlanarStack& in) {
  display::PlanarStack out;
  switch (in.normal()) {
    case v1::PlanarStack::Z:
      out.normal = display::PlanarStack::Normal::kZ;
      break;
    case v1::PlanarStack::Y:
      out.normal = display::PlanarStack::Normal::kY;
      break;
    default:
      return absl::InvalidArgumentError(absl::StrCat("planar_stack.normal has the unknown value ",
                                                     static_cast<int>(in.normal()), "; use Z, Y"));
  }
  out.width_px = in.width_px();
  out.height_px = in.height_px();
  out.pitch_u_mm = in.pitch_u_mm();
  out.pitch_v_mm = in.pitch_v_mm();
  out.positions_mm.assign(in.positions_mm().begin(), in.positions_mm().end());
  out.thickness_mm = in.thickness_mm();
  out.mirror_u = in.mirror_u();
  out.mirror_v = in.mirror_v();
  out.strokes = in.strokes() == 0 ? 1 : in.strokes();
  return out;
}

display::Helix ShapeFromWire(const v1::HelixScreen& in) {
  display::Helix out;
  out.slices_per_turn = in.slices_per_turn();
  out.width_px = in.width_px();
  out.height_px = in.height_px();
  out.pitch_u_mm = in.pitch_u_mm();
  out.pitch_v_mm = in.pitch_v_mm();
  out.blades = in.blades();
  out.span_turns = in.span_turns();
  out.height_mm = in.height_mm();
  out.hub_mm = in.hub_mm();
  out.radius_mm = in.radius_mm();
  out.phase_turns = in.phase_turns();
  out.left_handed = in.left_handed();
  out.clockwise = in.clockwise();
  out.mirror_u = in.mirror_u();
  out.mirror_v = in.mirror_v();
  return out;
}

display::Rotor ShapeFromWire(const v1::Rotor& in) {
  display::Rotor out;
  out.slices_per_turn = in.slices_per_turn();
  out.width_px = in.width_px();
  out.height_px = in.height_px();
  out.clockwise = in.clockwise();
  for (const v1::Rotor::Panel& panel : in.panels()) {
    display::Rotor::Panel to;
    to.pitch_u_mm = panel.pitch_u_mm();
    to.pitch_v_mm = panel.pitch_v_mm();
    to.eccentricity_mm = panel.eccentricity_mm();
    to.shift_u_mm = panel.shift_u_mm();
    to.shift_v_mm = panel.shift_v_mm();
    to.phase_turns = panel.phase_turns();
    to.mirror_u = panel.mirror_u();
    to.mirror_v = panel.mirror_v();
    to.tilt_deg = panel.tilt_deg();
    out.panels.push_back(to);
  }
  return out;
}

absl::StatusOr<display::Correction> CorrectionFromWire(const v1::Correction& in) {
  display::Correction out;
  if (in.affine_size() != 0 && in.affine_size() != 12) {
    return absl::InvalidArgumentError(absl::StrCat("correction.affine has ", in.affine_size(),
                                                   " values; it must have 12, or none"));
  }
  std::copy(in.affine().begin(), in.affine().end(), out.affine.begin());
  if (in.has_displacement()) {
    const v1::Correction::Displacement& from = in.displacement();
    if (from.at_mm_size() % 3 != 0) {
      return absl::InvalidArgumentError(absl::StrCat("correction.displacement.at_mm has ",
                                                     from.at_mm_size(),
                                                     " values; it must have x, y and z of each"));
    }
    display::DisplacementGrid& to = out.displacement.emplace();
    to.nx = from.nx();
    to.ny = from.ny();
    to.nz = from.nz();
    to.low_mm = FromWire(from.low_mm());
    to.high_mm = FromWire(from.high_mm());
    for (int i = 0; i < from.at_mm_size(); i += 3) {
      to.at_mm.push_back({from.at_mm(i), from.at_mm(i + 1), from.at_mm(i + 2)});
    }
  }
  if (in.homographies_size() % 9 != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "correction.homographies has ", in.homographies_size(), " values; it must have 9 of each"));
  }
  for (int i = 0; i < in.homographies_size(); i += 9) {
    std::array<double, 9>& to = out.homographies.emplace_back();
    std::copy_n(in.homographies().begin() + i, 9, to.begin());
  }
  return out;
}

// Checks sizes before it allocates memory, because a short message may announce many unlit pixels.
absl::StatusOr<display::Lattice> ShapeFromWire(const v1::Lattice& in) {
  const int64_t pixels = int64_t{in.slices()} * in.width_px();
  if (in.width_px() < 1 || in.slices() < 1 || pixels > display::kMaxLatticePixels) {
    return absl::InvalidArgumentError(absl::StrCat(
        "lattice.slices·width_px is ", in.slices(), "·", in.width_px(),
        "; both must be 1 at least, and their product at most ", display::kMaxLatticePixels));
  }
  const int lights = in.pixels_size();
  if (in.x_mm_size() != lights || in.y_mm_size() != lights || in.z_mm_size() != lights) {
    return absl::InvalidArgumentError(
        absl::StrCat("lattice.pixels, x_mm, y_mm and z_mm have ", lights, ", ", in.x_mm_size(),
                     ", ", in.y_mm_size(), " and ", in.z_mm_size(),
                     " values; each must have as many as there are lights"));
  }
  display::Lattice out;
  out.width_px = in.width_px();
  out.cell_mm = FromWire(in.cell_mm());
  out.points_mm.resize(static_cast<size_t>(pixels));
  int64_t least = 0;
  for (int n = 0; n < lights; ++n) {
    const int64_t pixel = in.pixels(n);
    if (pixel < least || pixel >= pixels) {
      return absl::InvalidArgumentError(
          absl::StrCat("lattice.pixels[", n, "] is ", pixel,
                       "; pixels must ascend strictly and be below slices·width_px, ", pixels));
    }
    out.points_mm[static_cast<size_t>(pixel)] = {in.x_mm(n), in.y_mm(n), in.z_mm(n)};
    least = pixel + 1;
  }
  return out;
}

}  // namespace

void ToWire(const display::Geometry& in, v1::Geometry* out) {
  std::visit([out](const auto& shape) { ShapeToWire(shape, out); }, in.shape);
  if (in.correction.has_value()) CorrectionToWire(*in.correction, out->mutable_correction());
  v1::VoxelGrid* grid = out->mutable_grid();
  grid->set_nx(in.grid.nx);
  grid->set_ny(in.grid.ny);
  grid->set_nz(in.grid.nz);
  ToWire(in.grid.pitch_mm, grid->mutable_pitch_mm());
  ToWire(in.grid.origin_mm, grid->mutable_origin_mm());
}

absl::StatusOr<display::Geometry> FromWire(const v1::Geometry& in) {
  display::Geometry out;
  switch (in.shape_case()) {
    case v1::Geometry::kPlanarStack: {
      absl::StatusOr<display::PlanarStack> shape = ShapeFromWire(in.planar_stack());
      if (!shape.ok()) return shape.status();
      out.shape = *std::move(shape);
      break;
    }
    case v1::Geometry::kRotor:
      out.shape = ShapeFromWire(in.rotor());
      break;
    case v1::Geometry::kHelix:
      out.shape = ShapeFromWire(in.helix());
      break;
    case v1::Geometry::kLattice: {
      absl::StatusOr<display::Lattice> shape = ShapeFromWire(in.lattice());
      if (!shape.ok()) return shape.status();
      out.shape = *std::move(shape);
      break;
    }
    default:
      return absl::InvalidArgumentError(
          "the geometry's shape is not set, or not known here; known are planar_stack, rotor, "
          "lattice, helix");
  }
  if (in.has_correction()) {
    absl::StatusOr<display::Correction> correction = CorrectionFromWire(in.correction());
    if (!correction.ok()) return correction.status();
    out.correction = *std::move(correction);
  }
  out.grid = {in.grid().nx(), in.grid().ny(), in.grid().nz(), FromWire(in.grid().pitch_mm()),
              FromWire(in.grid().origin_mm())};
  return out;
}

}  // namespace voxeld::daemon::wire
