// voxelctl calibrate: walks a person through how a display was put together, on the display itself, and writes its profile.
#pragma once

#include <istream>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"

namespace voxeld::voxelctl {

// Questions go to the console, answers come from `in`, a line each. Each change is shown on the display before the next question.
// InvalidArgument: the display's text is wrong; Unavailable: the display cannot be opened; AlreadyExists: the file is there;
// FailedPrecondition: the answers ended before the questions, and nothing was written.
absl::Status Calibrate(const CalibrateOptions& options, std::istream& in, Console& console);

}  // namespace voxeld::voxelctl
