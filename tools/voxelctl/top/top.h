// The command `top`: shows the state of the server and its displays, live.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Shows a dashboard if standard input and output are a terminal and neither --once nor --json is
// given; it keeps running and waits if the server disconnects. Otherwise writes tables, or one JSON
// document per line, to the console. `colors` allows the dashboard to use colours. Ends without an
// error with q and with an interrupt.
absl::Status Top(const TopOptions& options, bool colors, Connection& connection,
                 Interrupt& interrupt, Console& console);

}  // namespace voxeld::voxelctl
