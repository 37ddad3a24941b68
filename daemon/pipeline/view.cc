#include "daemon/pipeline/view.h"

#include <algorithm>
#include <cmath>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "daemon/scene/bounds.h"

namespace voxeld::daemon {
namespace {

// voxel = scale · scene + offset, axis by axis.
gpu::Affine AxisMap(const double scale[3], const double offset[3]) {
  gpu::Affine map;
  for (int axis = 0; axis < 3; ++axis) {
    map.m[axis * 5] = scale[axis];
    map.m[axis * 4 + 3] = offset[axis];
  }
  return map;
}

}  // namespace

absl::StatusOr<gpu::Affine> SceneToVoxel(const ViewOptions& view, const display::VoxelGrid& grid) {
  if (!IsFinite(view.transform)) {
    return absl::InvalidArgumentError("view.transform has a value that is not finite");
  }
  if (IsSingular(view.transform)) {
    return absl::InvalidArgumentError(
        absl::StrCat("view.transform cannot be inverted: ", DescribeLinear(view.transform),
                     "; its linear part must have full rank"));
  }
  if (view.box.has_value() && view.mode != ViewOptions::Mode::kFit) {
    return absl::InvalidArgumentError(
        "view.box (view_box in the configuration) is for mode FIT; leave it out of the others");
  }

  const double cells[3] = {double(grid.nx), double(grid.ny), double(grid.nz)};
  const double pitch[3] = {grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z};
  const double origin[3] = {grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z};
  double scale[3] = {1, 1, 1}, offset[3] = {0, 0, 0};
  switch (view.mode) {
    case ViewOptions::Mode::kVoxels:
      break;
    case ViewOptions::Mode::kMillimetres:
      for (int axis = 0; axis < 3; ++axis) {
        scale[axis] = 1 / pitch[axis];
        offset[axis] = -origin[axis] / pitch[axis];
      }
      break;
    case ViewOptions::Mode::kFit: {
      double center[3] = {0, 0, 0};
      double mm_per_unit = 0;
      if (view.box.has_value()) {
        const auto& [low, high] = *view.box;
        const double min[3] = {low.x, low.y, low.z}, max[3] = {high.x, high.y, high.z};
        for (int axis = 0; axis < 3; ++axis) {
          const double size = max[axis] - min[axis];
          if (!(size > 0) || !std::isfinite(size)) {
            return absl::InvalidArgumentError(absl::StrFormat(
                "view.box is from %g to %g on axis %c; min must be less than max, both finite",
                min[axis], max[axis], "xyz"[axis]));
          }
          center[axis] = min[axis] + size / 2;
          const double fits = cells[axis] * pitch[axis] / size;
          mm_per_unit = axis == 0 ? fits : std::min(mm_per_unit, fits);
        }
      } else {
        for (int axis = 0; axis < 3; ++axis) {
          mm_per_unit = std::max(mm_per_unit, cells[axis] * pitch[axis] / 2);
        }
      }
      for (int axis = 0; axis < 3; ++axis) {
        scale[axis] = mm_per_unit / pitch[axis];
        offset[axis] = cells[axis] / 2 - scale[axis] * center[axis];
      }
      break;
    }
  }
  const gpu::Affine map = gpu::Compose(AxisMap(scale, offset), view.transform);
  if (!IsFinite(map) || IsSingular(map)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the view maps the scene to voxels by ", DescribeLinear(map),
        ", which is not finite or cannot be inverted; choose a box or transform nearer "
        "to the size of the display"));
  }
  return map;
}

}  // namespace voxeld::daemon
