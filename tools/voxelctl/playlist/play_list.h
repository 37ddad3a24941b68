// voxelctl playlist: plays recordings and presets one after another, cross-faded, each at its
// hours.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "tools/voxelctl/cli/options.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/playlist/playlist.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

// Returns the local time of day and week.
WeekMinute LocalWeekMinute();

// Plays until an interrupt, which is not an error, or, without `loop`, until the end of the last
// item. An item that cannot be played is reported once and skipped. Errors: if no item can be
// played, at any hour, or the server disconnects. With --json it writes a line for each item when
// it is shown. With `check` it only reads the files and reports what would be shown now;
// InvalidArgument then names every item that would be skipped. `connect` is called only for
// playing.
absl::Status PlayList(const PlaylistOptions& options, const Connector& connect,
                      const std::function<WeekMinute()>& now, Interrupt& interrupt,
                      Console& console);

}  // namespace voxeld::voxelctl
