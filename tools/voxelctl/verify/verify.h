// The command `verify`: runs a protocol's conformance suite on the devices of a display, which it
// opens itself, without a daemon.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Returns: OK if no case failed. Errors: FailedPrecondition if some failed; InvalidArgument if the
// display's text, the filter or the file is wrong, with what would be valid; Unavailable if the
// device is missing or in use by another program; Cancelled if it was interrupted, in which case
// the device was stopped.
absl::Status Verify(const VerifyOptions& options, Interrupt& interrupt, Console& console);

}  // namespace voxeld::voxelctl
