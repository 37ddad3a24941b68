// Ends test patterns, so that the scene is seen again.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// On every display of the server; the names of those that had one up, as the server spells them.
// The first call that fails ends it: what was ended before stays so.
absl::StatusOr<std::vector<std::string>> EndPatterns(Connection& connection);

}  // namespace voxeld::voxelctl
