// The command `profile`: what a display's description comes to, without a daemon or a device.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// InvalidArgument: the profile is wrong, with the field, its value and what would be right. NotFound: there is none of that name.
absl::Status ShowProfile(const ProfileOptions& options, Console& console);

// Those that are installed.
std::vector<std::string> ProfileNames();

}  // namespace voxeld::voxelctl
