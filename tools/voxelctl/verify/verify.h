// The command `verify`: a protocol's conformance suite over the devices of a display, which it opens
// itself, without a daemon.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// OK: no case failed. FailedPrecondition: some did. InvalidArgument: the display's text, the filter
// or the file is wrong, with what would be right. Unavailable: the device is not there, or another
// program has it. Cancelled: interrupted; the device was stopped.
absl::Status Verify(const VerifyOptions& options, Interrupt& interrupt, Console& console);

}  // namespace voxeld::voxelctl
