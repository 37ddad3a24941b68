// voxelctl record and replay: write a daemon's scene to a file, and play it from there.
#pragma once

#include <istream>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Records until an interrupt, which is not an error, or until the duration has elapsed. Killing
// this process loses at most the last second. With --json it writes one object at the end: change
// sets, bytes.
absl::Status Record(const RecordOptions& options, const Connector& connect, Interrupt& interrupt,
                    Console& console);

// Plays at the recorded pace, or one change set for each line of `in`. Removes its contents at the
// end unless they are to be kept. With --json it writes a line for each change set: its time in the
// file, the recorded snapshot, and the new snapshot.
absl::Status Replay(const ReplayOptions& options, const Connector& connect, Interrupt& interrupt,
                    std::istream& in, Console& console);

}  // namespace voxeld::voxelctl
