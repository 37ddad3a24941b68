// voxelctl markers: what a robot's programs show in their viewers, put up as it comes.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Until an interrupt, which is no error; Unavailable when either server goes. Each update is one commit. What cannot be read is
// counted and told, and the rest goes on. With --json a line when it is connected, a line of counts at most each second while messages come, and one at the end.
absl::Status FollowMarkers(const MarkersOptions& options, const Connector& connect,
                           Interrupt& interrupt, Console& console);

}  // namespace voxeld::voxelctl
