// The layers that play and draw put everything into: what earlier commands left there.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/connection/owned_layers.h"

namespace voxeld::voxelctl {

// kLayer and kMaskLayer, of all owners that have them.
absl::StatusOr<std::vector<OwnedLayer>> DrawnBefore(Connection& connection);

}  // namespace voxeld::voxelctl
