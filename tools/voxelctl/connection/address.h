// Which server is meant.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "voxeld/address.h"

namespace voxeld::voxelctl {

using client::Environment;

// `option` if it is not empty, else what every client takes.
std::string ChooseServer(const std::string& option, const Environment& environment);

// HOST:PORT or unix:PATH as gRPC writes it; InvalidArgument with the text, fit for a terminal, and
// what would be right.
absl::StatusOr<std::string> ServerTarget(const std::string& address);

}  // namespace voxeld::voxelctl
