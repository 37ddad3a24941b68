// Selects the lights of a command.
#pragma once

#include "absl/status/statusor.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/lights/light_map.h"

namespace voxeld::voxelctl {

// Errors: NotFound if the display does not exist or the server has none; otherwise what is wrong
// with the layout file, with its name.
absl::StatusOr<LightMap> ChooseLights(const LightsOptions& options, Connection& connection);

}  // namespace voxeld::voxelctl
