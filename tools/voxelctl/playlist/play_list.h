// voxelctl playlist: recordings and presets one after another, cross-faded, each at its hours.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/playlist/playlist.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// The local time of day and week.
WeekMinute LocalWeekMinute();

// Until an interrupt, which is no error, or, without `loop`, the end of the last. An item that cannot be played is told once and
// passed over; when none can, be it at other hours, or the server goes away, that is the error. With --json a line for each item as it comes up.
// With `check` the files alone are read, and what would be on now is told; InvalidArgument has every item that would be
// passed over. `connect` is called when it is to be played.
absl::Status PlayList(const PlaylistOptions& options, const Connector& connect,
                      const std::function<WeekMinute()>& now, Interrupt& interrupt,
                      Console& console);

}  // namespace voxeld::voxelctl
