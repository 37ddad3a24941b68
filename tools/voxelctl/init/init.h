// voxelctl init: asks how an LED lattice is wired, in the words that xLights has for it, and writes its profile. Needs no daemon.
#pragma once

#include <istream>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Questions go to the console, answers come from `in`, a line each; an empty one takes the default. What an answer cannot be is said,
// and asked again. FailedPrecondition if the answers end before the questions; AlreadyExists if the file does.
absl::Status Init(const InitOptions& options, std::istream& in, Console& console);

}  // namespace voxeld::voxelctl
