// voxelctl record and replay: a daemon's scene into a file, and from it again.
#pragma once

#include <istream>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Until an interrupt, which is no error, or the duration's end. What a kill of this process loses is the last
// second at most. With --json one object at the end: change sets, bytes.
absl::Status Record(const RecordOptions& options, const Connector& connect, Interrupt& interrupt,
                    Console& console);

// At the pace at which it was recorded, or by a line of `in` for each change set. What it put up goes at the
// end, unless it is to stay. With --json a line for each change set: its time in the file, the snapshot that it
// was, the one that it is now.
absl::Status Replay(const ReplayOptions& options, const Connector& connect, Interrupt& interrupt,
                    std::istream& in, Console& console);

}  // namespace voxeld::voxelctl
