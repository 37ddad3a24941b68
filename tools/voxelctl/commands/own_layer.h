// The layer that voxelctl puts everything into: what earlier commands left there.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/connection/connection.h"

namespace voxeld::voxelctl {

// Owners that have something in it.
absl::StatusOr<std::vector<uint64_t>> OwnersBefore(Connection& connection);
// Takes away what these have there; nothing is as good as gone.
absl::Status TakeDown(const std::vector<uint64_t>& owners, Connection& connection);

}  // namespace voxeld::voxelctl
