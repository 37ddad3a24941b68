// The map from the scene to a display's voxels.
#pragma once

#include "absl/status/statusor.h"
#include "daemon/pipeline/display_settings.h"
#include "display/api/geometry.h"
#include "gpu/affine.h"

namespace voxeld::daemon {

// Scene units → voxel space of `grid` (voxel i is [i, i+1));
// `view.transform` is applied to the scene first.
//   kFit          the box, centred in the volume and as large as fits; a unit is as many
//                 millimetres on every axis
//   kMillimetres  a unit is a millimetre, the origin the display's
//   kVoxels       a unit is a voxel, the origin the corner of voxel (0,0,0)
// InvalidArgument with the field, its value and what would be right.
absl::StatusOr<gpu::Affine> SceneToVoxel(const ViewOptions& view, const display::VoxelGrid& grid);

}  // namespace voxeld::daemon
