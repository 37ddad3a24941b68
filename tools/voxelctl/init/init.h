// voxelctl init: asks how an LED lattice is wired, with xLights' terms, and writes its profile.
// Needs no daemon.
#pragma once

#include <istream>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Questions go to the console, and answers come from `in`, one per line; an empty one selects the
// default. An invalid answer is reported, and the question is asked again. Errors:
// FailedPrecondition if the answers end early; AlreadyExists if the file exists.
absl::Status Init(const InitOptions& options, std::istream& in, Console& console);

}  // namespace voxeld::voxelctl
