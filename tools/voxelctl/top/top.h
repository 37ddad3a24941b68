// The command `top`: how the server and its displays do, live.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// A dashboard where standard input and output are a terminal and it is neither --once nor --json; it outlives the server, whose
// return it waits for. Else tables, or a JSON document a line, to the console. `colors`: the dashboard may have them. Ends without
// an error by q and by an interrupt.
absl::Status Top(const TopOptions& options, bool colors, Connection& connection,
                 Interrupt& interrupt, Console& console);

}  // namespace voxeld::voxelctl
