#include "daemon/wire/fields.h"

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::wire {

MaybeFault ToVector(const FieldPath& path, const v1::Vec3& in, gpu::implicit::Vector* out) {
  if (auto fault = CheckVec3(path, in)) return fault;
  *out = {in.x(), in.y(), in.z()};
  return {};
}

MaybeFault CheckNotNegative(const FieldPath& path, double value) {
  if (auto fault = CheckFloat(path, value)) return fault;
  if (value >= 0) return {};
  return Fault{path.ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", Show(value), "; give 0 or more")};
}

MaybeFault ToThickness(const FieldPath& path, const v1::Thickness& in, const Limits& limits,
                       gpu::GeometryRecord* out) {
  const float value = in.value();
  if (auto fault = CheckFinite(FieldPath(path, "value"), value)) return fault;
  if (value < 0 || value > limits.max_thickness) {
    return Fault{FieldPath(path, "value").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", Show(value), "; give 0 (one voxel) to max_thickness, ",
                              limits.max_thickness)};
  }
  switch (in.unit()) {
    case v1::Thickness::UNIT_UNSPECIFIED:
    case v1::Thickness::VOXELS:
      out->thickness_unit = gpu::ThicknessUnit::kVoxels;
      break;
    case v1::Thickness::UNITS:
      out->thickness_unit = gpu::ThicknessUnit::kUnits;
      break;
    default:
      return UnknownEnum(FieldPath(path, "unit"), in.unit(), "VOXELS, UNITS");
  }
  out->thickness = value;
  return {};
}

MaybeFault ToShell(const FieldPath& path, const v1::Thickness& in, bool is_surface,
                   const Limits& limits, gpu::GeometryRecord* out) {
  const FieldPath shell(path, "shell");
  if (auto fault = ToThickness(shell, in, limits, out)) return fault;
  if (is_surface || out->thickness == 0) return {};
  return Fault{
      FieldPath(shell, "value").ToString(), Reason::kInvalidValue,
      absl::StrCat(
          "is ", Show(in.value()),
          ", but only what is drawn as FILL_SURFACE has a shell; leave one of the two out")};
}

MaybeFault ToRule(const FieldPath& path, v1::SurfaceRule in, gpu::GeometryRecord* out) {
  switch (in) {
    case v1::SURFACE_RULE_UNSPECIFIED:
    case v1::SURFACE_RULE_THIN:
      out->rule = gpu::SurfaceRule::kThin;
      return {};
    case v1::SURFACE_RULE_COVER:
      out->rule = gpu::SurfaceRule::kCover;
      return {};
    default:
      return UnknownEnum(FieldPath(path, "rule"), in, "SURFACE_RULE_THIN, SURFACE_RULE_COVER");
  }
}

MaybeFault ToSampling(const FieldPath& path, v1::LineSampling in, gpu::GeometryRecord* out) {
  switch (in) {
    case v1::LINE_SAMPLING_UNSPECIFIED:
    case v1::LINE_SAMPLING_THIN:
      out->sampling = gpu::LineSampling::kThin;
      return {};
    case v1::LINE_SAMPLING_EUCLIDEAN:
      out->sampling = gpu::LineSampling::kEuclidean;
      return {};
    case v1::LINE_SAMPLING_COVER:
      out->sampling = gpu::LineSampling::kCover;
      return {};
    default:
      return UnknownEnum(FieldPath(path, "sampling"), in,
                         "LINE_SAMPLING_THIN, LINE_SAMPLING_EUCLIDEAN, LINE_SAMPLING_COVER");
  }
}

MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out, bool* framed) {
  *framed = in == v1::FILL_LINES || in == v1::FILL_DOTS;
  if (*framed) return {};
  if (in == v1::FILL_UNSPECIFIED || in == v1::FILL_SURFACE || in == v1::FILL_SOLID) {
    return ToFill(path, in, out);
  }
  return UnknownEnum(FieldPath(path, "fill"), in,
                     "FILL_SURFACE, FILL_SOLID, FILL_LINES, FILL_DOTS");
}

MaybeFault ToFill(const FieldPath& path, v1::Fill in, gpu::GeometryRecord* out) {
  switch (in) {
    case v1::FILL_UNSPECIFIED:
    case v1::FILL_SURFACE:
      out->fill = gpu::Fill::kSurface;
      return {};
    case v1::FILL_SOLID:
      out->fill = gpu::Fill::kSolid;
      return {};
    case v1::FILL_LINES:
    case v1::FILL_DOTS:
      return Fault{FieldPath(path, "fill").ToString(), Reason::kInvalidValue,
                   in == v1::FILL_LINES
                       ? "is FILL_LINES, which it has none of; give FILL_SURFACE or FILL_SOLID"
                       : "is FILL_DOTS, which it has none of; give FILL_SURFACE or FILL_SOLID"};
    default:
      return UnknownEnum(FieldPath(path, "fill"), in, "FILL_SURFACE, FILL_SOLID");
  }
}

}  // namespace voxeld::daemon::wire
