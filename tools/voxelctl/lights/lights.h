// Shows lights by number: from the protocols of LED controllers, and raw from another program.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Receives light data from the network until an interrupt, which is not an error, and shows the
// newest picture whenever the server can accept it. Reconnects if the connection is lost. With
// --json it writes a line when it listens, and one per second with the counts of all messages and
// pictures, the last one at the end.
absl::Status Input(const InputOptions& options, const Connector& connect, Interrupt& interrupt,
                   Console& console);

// Shows all pictures that `descriptor` delivers, at the rate at which the server accepts them or at
// the options' rate, until the input ends. Errors: InvalidArgument if the input ends within a
// picture. With --json it writes one object at the end.
absl::Status Pipe(const PipeOptions& options, const Connector& connect, Interrupt& interrupt,
                  int descriptor, Console& console);

}  // namespace voxeld::voxelctl
