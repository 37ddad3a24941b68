// The command `profile`: shows the result of a display's description, without a daemon or a device.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Errors: InvalidArgument if the profile is wrong, with the field, its value and what would be
// valid; NotFound if no profile has that name.
absl::Status ShowProfile(const ProfileOptions& options, Console& console);

// Returns the installed profiles.
std::vector<std::string> ProfileNames();

}  // namespace voxeld::voxelctl
