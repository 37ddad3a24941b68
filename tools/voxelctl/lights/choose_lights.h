// Which lights a command means.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/lights/light_map.h"

namespace voxeld::voxelctl {

// NotFound if there is no such display, or none at all; what is wrong with the layout's file, by its name.
absl::StatusOr<LightMap> ChooseLights(const LightsOptions& options, Connection& connection);

}  // namespace voxeld::voxelctl
