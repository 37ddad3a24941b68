// Selects the server.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "voxeld/address.h"

namespace voxeld::voxelctl {

using client::Environment;

// Returns `option` if it is not empty, otherwise the address that every client uses.
std::string ChooseServer(const std::string& option, const Environment& environment);

// Converts HOST:PORT or unix:PATH to gRPC's notation. Errors: InvalidArgument with the text,
// escaped for a terminal, and what would be valid.
absl::StatusOr<std::string> ServerTarget(const std::string& address);

}  // namespace voxeld::voxelctl
