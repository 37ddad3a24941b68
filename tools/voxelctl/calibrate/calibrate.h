// voxelctl calibrate: asks a person how a display is assembled, with test patterns on the display
// itself, and writes its profile.
#pragma once

#include <istream>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Questions go to the console, and answers come from `in`, one per line. Each change is shown on
// the display before the next question. Errors: InvalidArgument if the display's text is wrong;
// Unavailable if the display cannot be opened; AlreadyExists if the file exists; FailedPrecondition
// if the answers ended early, in which case nothing was written.
absl::Status Calibrate(const CalibrateOptions& options, std::istream& in, Console& console);

}  // namespace voxeld::voxelctl
