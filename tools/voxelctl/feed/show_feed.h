// Shows a feed of markers as it is received.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "tools/markers/marker_feed.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

struct FeedShowing {
  std::string source;               // description of the source for people
  std::string channel = "channel";  // what one of the subscribed items is called, for people
  std::string layer;
  std::string client_name;
  bool reconnect = true;  // waits for a server that is unreachable; otherwise ends
};

// Runs until an interrupt, which is not an error. Otherwise returns the feed's status when it ends,
// or the session's (Unavailable) when that ends. Each update is one commit. Unreadable parts are
// counted and reported, and the rest continues. With --json it writes a line when it is connected,
// one for each of the feed's news, a line of counts at most every second while messages come, and
// one at the end.
absl::Status ShowFeed(const FeedShowing& showing, markers::MarkerFeed& feed, Connection& connection,
                      Interrupt& interrupt, Console& console);

// Returns the status with its message escaped for a terminal.
absl::Status Escaped(const absl::Status& status);

}  // namespace voxeld::voxelctl
