// Selects the displays of a command.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// Returns the named display, or all of the server's if `wanted` is empty. Errors:
// FailedPrecondition if it has none.
absl::StatusOr<std::vector<std::string>> DisplayNames(const std::string& wanted,
                                                      Connection& connection);

}  // namespace voxeld::voxelctl
