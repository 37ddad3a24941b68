// Finds what earlier commands left in the layers that play and draw use.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/connection/owned_layers.h"

namespace voxeld::voxelctl {

// Returns kLayer and kMaskLayer, for all owners that have them.
absl::StatusOr<std::vector<OwnedLayer>> DrawnBefore(Connection& connection);

}  // namespace voxeld::voxelctl
