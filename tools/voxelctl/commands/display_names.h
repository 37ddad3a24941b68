// Which displays a command means.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// The one named, or all of the server's if `wanted` is empty: FailedPrecondition if it has none.
absl::StatusOr<std::vector<std::string>> DisplayNames(const std::string& wanted,
                                                      Connection& connection);

}  // namespace voxeld::voxelctl
