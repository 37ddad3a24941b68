#include "daemon/wire/clip.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "daemon/wire/fields.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

MaybeFault ToPoint(const FieldPath& path, const v1::Vec3& in, double (&out)[3]) {
  if (auto fault = CheckFinite(FieldPath(path, "x"), in.x())) return fault;
  if (auto fault = CheckFinite(FieldPath(path, "y"), in.y())) return fault;
  if (auto fault = CheckFinite(FieldPath(path, "z"), in.z())) return fault;
  out[0] = in.x(), out[1] = in.y(), out[2] = in.z();
  return {};
}

MaybeFault ToPlane(const FieldPath& path, const v1::Clip::Plane& in, gpu::ClipPlane* out) {
  if (auto fault = CheckFinite(FieldPath(path, "a"), in.a())) return fault;
  if (auto fault = CheckFinite(FieldPath(path, "b"), in.b())) return fault;
  if (auto fault = CheckFinite(FieldPath(path, "c"), in.c())) return fault;
  if (auto fault = CheckFinite(FieldPath(path, "d"), in.d())) return fault;
  if (in.a() == 0 && in.b() == 0 && in.c() == 0) {
    return Fault{path.ToString(), Reason::kInvalidValue,
                 "has the normal (0, 0, 0); one of a, b, c must not be 0"};
  }
  *out = {in.a(), in.b(), in.c(), in.d()};
  return {};
}

MaybeFault ToBox(const FieldPath& path, const v1::Clip::Box& in, ClipBox* out) {
  if (auto fault = ToPoint(FieldPath(path, "center"), in.center(), out->center)) return fault;
  const FieldPath size(path, "size");
  if (auto fault = ToPoint(size, in.size(), out->size)) return fault;
  for (const double edge : out->size) {
    if (edge > 0) continue;
    return Fault{size.ToString(), Reason::kInvalidValue,
                 absl::StrCat("has an edge of ", Show(edge), "; all three must be greater than 0")};
  }
  return ToAffine(FieldPath(path, "transform"), in.transform(), &out->transform);
}

MaybeFault ToCylinder(const FieldPath& path, const v1::Clip::Cylinder& in, ClipCylinder* out) {
  if (auto fault = ToPoint(FieldPath(path, "start"), in.start(), out->start)) return fault;
  if (auto fault = ToPoint(FieldPath(path, "end"), in.end(), out->end)) return fault;
  if (std::equal(out->start, out->start + 3, out->end)) {
    return Fault{FieldPath(path, "end").ToString(), Reason::kInvalidValue,
                 "is where start is; the two must be apart"};
  }
  out->radius = in.radius();
  if (std::isfinite(in.radius()) && in.radius() > 0) return {};
  return Fault{FieldPath(path, "radius").ToString(), Reason::kInvalidValue,
               absl::StrCat("is ", Show(in.radius()), "; give a number greater than 0")};
}

}  // namespace

MaybeFault ToClip(const FieldPath& path, const v1::Clip& in, const Limits& limits, Clip* out) {
  // Never exceeds the engine's capacity, whatever the limits.
  const uint64_t most = std::min(limits.max_clip_planes, gpu::kMaxClipPlanes);
  const uint64_t most_cylinders = std::min(limits.max_clip_cylinders, gpu::kMaxClipCylinders);
  const uint64_t boxes = static_cast<uint64_t>(in.boxes_size()),
                 cylinders = static_cast<uint64_t>(in.cylinders_size());
  const uint64_t planes = static_cast<uint64_t>(in.planes_size()) + Clip::kBoxPlanes * boxes +
                          Clip::kCylinderPlanes * cylinders;
  if (planes > most) {
    return Fault{FieldPath(path, "planes").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("has ", planes, " planes",
                              boxes + cylinders == 0 ? "" : " with those of boxes and cylinders",
                              "; max_clip_planes allows ", most)};
  }
  if (cylinders > most_cylinders) {
    return Fault{
        FieldPath(path, "cylinders").ToString(), Reason::kQuotaExceeded,
        absl::StrCat("has ", cylinders, " cylinders; max_clip_cylinders allows ", most_cylinders)};
  }
  for (const v1::Clip::Plane& plane : in.planes()) {
    const FieldPath at(path, "planes", out->count);
    if (auto fault = ToPlane(at, plane, &out->planes[out->count++])) return fault;
  }
  for (const v1::Clip::Box& box : in.boxes()) {
    const FieldPath at(path, "boxes", out->boxes_count);
    if (auto fault = ToBox(at, box, &out->boxes[out->boxes_count++])) return fault;
  }
  for (const v1::Clip::Cylinder& cylinder : in.cylinders()) {
    const FieldPath at(path, "cylinders", out->cylinders_count);
    if (auto fault = ToCylinder(at, cylinder, &out->cylinders[out->cylinders_count++])) {
      return fault;
    }
  }
  gpu::LayerRecord record;
  if (PutClip(*out, record)) return {};
  return Fault{
      path.ToString(), Reason::kInvalidValue,
      "has a box or a cylinder that is too small, too large or too far away for numbers in "
      "double precision"};
}

}  // namespace voxeld::daemon::wire
