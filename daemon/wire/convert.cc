#include "daemon/wire/convert.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <variant>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "daemon/wire/check.h"
#include "display/geometry/limits.h"

namespace voxeld::daemon::wire {
namespace {

absl::Status Refused(const Fault& fault) {
  return absl::InvalidArgumentError(absl::StrCat(fault.field, " ", fault.message));
}

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
      return Refused(UnknownEnum(FieldPath("planar_stack.normal"), in.normal(), "Z, Y"));
  }
  out.width_px = in.width_px();
  out.height_px = in.height_px();
  out.pitch_u_mm = in.pitch_u_mm();
  out.pitch_v_mm = in.pitch_v_mm();
  out.positions_mm.assign(in.positions_mm().begin(), in.positions_mm().end());
  out.thickness_mm = in.thickness_mm();
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
    out.panels.push_back(to);
  }
  return out;
}

// Looks at sizes before it takes memory: a short message may name many pixels without a light.
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

void ToWire(const display::Vec3& in, v1::Vec3* out) {
  out->set_x(in.x);
  out->set_y(in.y);
  out->set_z(in.z);
}

display::Vec3 FromWire(const v1::Vec3& in) { return {in.x(), in.y(), in.z()}; }

void ToWire(const gpu::Affine& in, v1::Affine* out) { out->mutable_m()->Assign(in.m, in.m + 12); }

void ToWire(const Clip& in, v1::Clip* out) {
  for (uint32_t i = 0; i < in.count; ++i) {
    v1::Clip::Plane* plane = out->add_planes();
    plane->set_a(in.planes[i].a);
    plane->set_b(in.planes[i].b);
    plane->set_c(in.planes[i].c);
    plane->set_d(in.planes[i].d);
  }
  const auto put = [](const double(&from)[3], v1::Vec3* to) {
    ToWire(display::Vec3{from[0], from[1], from[2]}, to);
  };
  for (uint32_t i = 0; i < in.boxes_count; ++i) {
    v1::Clip::Box* box = out->add_boxes();
    put(in.boxes[i].center, box->mutable_center());
    put(in.boxes[i].size, box->mutable_size());
    ToWire(in.boxes[i].transform, box->mutable_transform());
  }
  for (uint32_t i = 0; i < in.cylinders_count; ++i) {
    v1::Clip::Cylinder* cylinder = out->add_cylinders();
    put(in.cylinders[i].start, cylinder->mutable_start());
    put(in.cylinders[i].end, cylinder->mutable_end());
    cylinder->set_radius(in.cylinders[i].radius);
  }
}

void ToWire(const gpu::Region& in, v1::Box3* out) {
  ToWire(display::Vec3{in.min[0], in.min[1], in.min[2]}, out->mutable_min());
  ToWire(display::Vec3{in.max[0], in.max[1], in.max[2]}, out->mutable_max());
}

void ToWire(const display::Geometry& in, v1::Geometry* out) {
  std::visit([out](const auto& shape) { ShapeToWire(shape, out); }, in.shape);
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
    case v1::Geometry::kLattice: {
      absl::StatusOr<display::Lattice> shape = ShapeFromWire(in.lattice());
      if (!shape.ok()) return shape.status();
      out.shape = *std::move(shape);
      break;
    }
    default:
      return absl::InvalidArgumentError(
          "the geometry's shape is not set, or not known here; known are planar_stack, rotor, "
          "lattice");
  }
  out.grid = {in.grid().nx(), in.grid().ny(), in.grid().nz(), FromWire(in.grid().pitch_mm()),
              FromWire(in.grid().origin_mm())};
  return out;
}

void ToWire(const display::FrameLayout& in, v1::FrameLayout* out) {
  out->set_slices(in.slices);
  out->set_width(in.width);
  out->set_height(in.height);
  out->set_sub_frames(in.sub_frames);
  out->set_format(ToWire(in.format));
}

absl::StatusOr<display::FrameLayout> FromWire(const v1::FrameLayout& in) {
  absl::StatusOr<display::PixelFormat> format = FromWire(in.format());
  if (!format.ok()) return format.status();
  return display::FrameLayout{in.slices(), in.width(), in.height(), in.sub_frames(), *format};
}

void ToWire(const ViewOptions& in, v1::View* out) {
  switch (in.mode) {
    case ViewOptions::Mode::kFit:
      out->set_mode(v1::View::FIT);
      break;
    case ViewOptions::Mode::kMillimetres:
      out->set_mode(v1::View::MILLIMETRES);
      break;
    case ViewOptions::Mode::kVoxels:
      out->set_mode(v1::View::VOXELS);
      break;
  }
  if (in.box.has_value()) {
    ToWire(in.box->first, out->mutable_box()->mutable_min());
    ToWire(in.box->second, out->mutable_box()->mutable_max());
  }
  ToWire(in.transform, out->mutable_transform());
}

absl::StatusOr<ViewOptions> FromWire(const v1::View& in) {
  const FieldPath path("view");
  ViewOptions out;
  switch (in.mode()) {
    case v1::View::MODE_UNSPECIFIED:
    case v1::View::FIT:
      out.mode = ViewOptions::Mode::kFit;
      break;
    case v1::View::MILLIMETRES:
      out.mode = ViewOptions::Mode::kMillimetres;
      break;
    case v1::View::VOXELS:
      out.mode = ViewOptions::Mode::kVoxels;
      break;
    default:
      return Refused(UnknownEnum(FieldPath(path, "mode"), in.mode(), "FIT, MILLIMETRES, VOXELS"));
  }
  if (in.has_box()) {
    if (out.mode != ViewOptions::Mode::kFit) {
      return absl::InvalidArgumentError("view.box is set; it goes with mode FIT only");
    }
    if (auto fault = CheckBox(FieldPath(path, "box"), in.box())) return Refused(*fault);
    out.box.emplace(FromWire(in.box().min()), FromWire(in.box().max()));
  }
  if (auto fault = ToAffine(FieldPath(path, "transform"), in.transform(), &out.transform)) {
    return Refused(*fault);
  }
  return out;
}

OwnerControl FromWire(const v1::ControlOwnerRequest& in) {
  OwnerControl out;
  out.owner = in.owner();
  if (in.has_hidden()) out.hidden = in.hidden();
  if (in.has_max_bytes()) out.max_bytes = in.max_bytes();
  if (in.has_max_entities()) out.max_entities = in.max_entities();
  out.evict = in.evict();
  return out;
}

absl::StatusOr<DisplayUpdate> FromWire(const v1::UpdateDisplayRequest& in) {
  DisplayUpdate out;
  if (in.has_brightness()) {
    if (!(in.brightness() >= 0 && in.brightness() <= 1)) {
      return absl::InvalidArgumentError(
          absl::StrCat("brightness is ", Show(in.brightness()), "; give 0 to 1"));
    }
    out.brightness = in.brightness();
  }
  if (in.has_blank()) out.blank = in.blank();
  if (in.test_pattern() != v1::TEST_PATTERN_UNSPECIFIED) {
    absl::StatusOr<TestPattern> pattern = FromWire(in.test_pattern());
    if (!pattern.ok()) return pattern.status();
    out.pattern = *pattern;
  }
  if (in.has_view()) {
    absl::StatusOr<ViewOptions> view = FromWire(in.view());
    if (!view.ok()) return view.status();
    out.view = *std::move(view);
  }
  return out;
}

}  // namespace voxeld::daemon::wire
