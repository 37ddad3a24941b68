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

absl::Status StatusOf(const Fault& fault) {
  return absl::InvalidArgumentError(absl::StrCat(fault.field, " ", fault.message));
}

}  // namespace

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

void ToWire(const display::FrameLayout& in, v1::FrameLayout* out) {
  out->set_slices(in.slices);
  out->set_width(in.width);
  out->set_height(in.height);
  out->set_sub_frames(in.sub_frames);
  out->set_format(ToWire(in.format));
  out->set_bits(in.bits_per_channel());
}

absl::StatusOr<display::FrameLayout> FromWire(const v1::FrameLayout& in) {
  absl::StatusOr<display::PixelFormat> format = FromWire(in.format());
  if (!format.ok()) return format.status();
  display::FrameLayout layout{in.slices(), in.width(), in.height(), in.sub_frames(), *format};
  if (in.bits() != layout.bits_per_channel()) layout.bits = in.bits();
  return layout;
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
      return StatusOf(UnknownEnum(FieldPath(path, "mode"), in.mode(), "FIT, MILLIMETRES, VOXELS"));
  }
  if (in.has_box()) {
    if (out.mode != ViewOptions::Mode::kFit) {
      return absl::InvalidArgumentError("view.box is set; it goes with mode FIT only");
    }
    if (auto fault = CheckBox(FieldPath(path, "box"), in.box())) return StatusOf(*fault);
    out.box.emplace(FromWire(in.box().min()), FromWire(in.box().max()));
  }
  if (auto fault = ToAffine(FieldPath(path, "transform"), in.transform(), &out.transform)) {
    return StatusOf(*fault);
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
  if (in.has_power_limit_w()) out.power_limit_w = in.power_limit_w();
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
