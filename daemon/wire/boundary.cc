#include "daemon/wire/boundary.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "daemon/wire/fields.h"
#include "gpu/primitives/spline.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::ProgramSource;
using gpu::implicit::Vector;

// Returns: the vertices projected along the axis.
std::vector<Vector> Flattened(const v1::Boundary& in, int axis) {
  std::vector<Vector> points;
  for (int i = 0; i + 2 < in.points_size(); i += 3) {
    double at[3] = {in.points(i), in.points(i + 1), in.points(i + 2)};
    at[axis] = 0;
    points.push_back({at[0], at[1], at[2]});
  }
  return points;
}

double ExtentOf(const std::vector<Vector>& points) {
  double extent = 0;
  for (int a = 0; a < 3; ++a) {
    const auto [least, greatest] =
        std::minmax_element(points.begin(), points.end(),
                            [a](const Vector& p, const Vector& q) { return p[a] < q[a]; });
    extent = std::max(extent, (*greatest)[a] - (*least)[a]);
  }
  return extent;
}

// Converts smooth closed curves to lines. `ends` are replaced by the ends of the lines.
MaybeFault ToLines(const FieldPath& path, const std::vector<Vector>& vertices, gpu::SplineForm form,
                   const Limits& limits, std::vector<uint32_t>* ends, std::vector<float>* points) {
  const double error = kBoundaryError * ExtentOf(vertices);  // 0 without extent: no bends
  uint32_t begin = 0;
  for (uint32_t& end : *ends) {
    gpu::Spline spline{
        .points = {vertices.begin() + begin, vertices.begin() + end}, .form = form, .closed = true};
    begin = end;
    gpu::Spans spans;
    spline.Make(spans);
    for (size_t s = 0; s < spans.size(); ++s) {
      const Vector* const p = &spans.points()[s * 4];
      const double parts = gpu::PartsOfSpan(p, error);
      const size_t vertices = points->size() / 3;
      const auto made = static_cast<double>(vertices);
      if (!(made + parts <= limits.max_boundary_points)) {
        return Fault{FieldPath(path, "points").ToString(), Reason::kQuotaExceeded,
                     absl::StrCat("are of smooth curves that make more lines than "
                                  "max_boundary_points allows, ",
                                  limits.max_boundary_points, "; give fewer")};
      }
      for (double i = 0; i < parts; ++i) {
        const Vector at = gpu::OnSpan(p, i / parts);
        for (int a = 0; a < 3; ++a) {
          points->push_back(static_cast<float>(at[a]));
          if (std::isfinite(points->back())) continue;
          return Fault{FieldPath(path, "points").ToString(), Reason::kOutOfRange,
                       absl::StrCat("are of smooth curves that reach to ", Show(at[a]),
                                    ", beyond what single precision holds; give it a transform")};
        }
      }
    }
    end = static_cast<uint32_t>(points->size() / 3);
  }
  return {};
}

}  // namespace

MaybeFault ToRings(const FieldPath& path, const google::protobuf::RepeatedField<double>& points,
                   const google::protobuf::RepeatedField<uint32_t>& ends, const Limits& limits,
                   std::vector<uint32_t>* out) {
  const FieldPath at(path, "points");
  if (points.size() % 3 != 0 || points.size() == 0) {
    return Fault{at.ToString(), Reason::kSizeMismatch,
                 absl::StrCat("has ", points.size(), " numbers; give x, y and z of each vertex")};
  }
  if (static_cast<uint32_t>(points.size()) / 3 > limits.max_boundary_points) {
    return Fault{at.ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("has ", points.size() / 3, " vertices; max_boundary_points allows ",
                              limits.max_boundary_points)};
  }
  for (int i = 0; i < points.size(); ++i) {
    if (auto fault = CheckFloat(FieldPath(path, "points", i), points[i])) return fault;
  }
  const uint32_t vertices = static_cast<uint32_t>(points.size() / 3);
  out->assign(ends.begin(), ends.end());
  if (out->empty()) out->push_back(vertices);
  uint32_t begin = 0;
  for (size_t i = 0; i < out->size(); ++i) {
    const uint32_t end = (*out)[i];
    if (end < begin + 3 || end > vertices) {
      return Fault{FieldPath(path, "ends", static_cast<int64_t>(i)).ToString(),
                   Reason::kIndexOutOfRange,
                   begin + 3 > vertices
                       ? absl::StrCat("is ", end, " after ", begin, ", of ", vertices,
                                      " vertices; a curve has 3 at least: give more")
                       : absl::StrCat("is ", end, "; a curve has 3 vertices at least: give ",
                                      begin + 3, " to ", vertices)};
    }
    begin = end;
  }
  if (begin != vertices) {
    return Fault{FieldPath(path, "ends").ToString(), Reason::kSizeMismatch,
                 absl::StrCat("ends with ", begin, "; there are ", vertices, " vertices")};
  }
  return {};
}

MaybeFault ToBoundary(const FieldPath& path, const v1::Boundary& in, const Limits& limits,
                      ProgramSource* source, std::vector<uint32_t>* ends,
                      std::vector<float>* points) {
  switch (in.axis()) {
    case v1::Boundary::AXIS_UNSPECIFIED:
    case v1::Boundary::Z:
      source->ring_axis = 2;
      break;
    case v1::Boundary::X:
      source->ring_axis = 0;
      break;
    case v1::Boundary::Y:
      source->ring_axis = 1;
      break;
    default:
      return UnknownEnum(FieldPath(path, "axis"), in.axis(), "X, Y, Z");
  }
  gpu::SplineForm form = gpu::SplineForm::kCatmullRom;
  bool smooth = true;
  switch (in.form()) {
    case v1::Boundary::FORM_UNSPECIFIED:
    case v1::Boundary::POLYLINE:
      smooth = false;
      break;
    case v1::Boundary::CATMULL_ROM:
      break;
    case v1::Boundary::B_SPLINE:
      form = gpu::SplineForm::kBSpline;
      break;
    default:
      return UnknownEnum(FieldPath(path, "form"), in.form(), "POLYLINE, CATMULL_ROM, B_SPLINE");
  }
  if (auto fault = ToRings(path, in.points(), in.ends(), limits, ends)) return fault;
  if (!smooth) {
    for (const double number : in.points()) points->push_back(static_cast<float>(number));
    return {};
  }
  return ToLines(path, Flattened(in, source->ring_axis), form, limits, ends, points);
}

}  // namespace voxeld::daemon::wire
