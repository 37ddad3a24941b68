// voxelctl markers: shows what a robot's programs show in their viewers, as it is received.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Runs until an interrupt, which is not an error. Errors: Unavailable if either server disconnects.
// Each update is one commit. Unreadable parts are counted and reported, and the rest continues.
// With --json it writes a line when it is connected, a line of counts at most every second while
// messages come, and one at the end.
absl::Status FollowMarkers(const MarkersOptions& options, const Connector& connect,
                           Interrupt& interrupt, Console& console);

}  // namespace voxeld::voxelctl
