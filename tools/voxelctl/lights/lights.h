// Lights by their numbers: from the protocols of LED controllers, and raw from another program.
#pragma once

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Takes in what comes over the network until an interrupt, which is no error, and puts up the newest picture whenever
// the server has room. A lost connection is opened again. With --json a line when it listens, and one a second with
// what became of every message and picture; the last at its end.
absl::Status Input(const InputOptions& options, const Connector& connect, Interrupt& interrupt,
                   Console& console);

// Puts up picture after picture of `descriptor`, none left out, at the pace at which the server takes them or at the
// options', until its end. InvalidArgument if that is within a picture. With --json one object at the end.
absl::Status Pipe(const PipeOptions& options, const Connector& connect, Interrupt& interrupt,
                  int descriptor, Console& console);

}  // namespace voxeld::voxelctl
