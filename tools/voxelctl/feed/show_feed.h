// What a feed of markers tells of, put up as it comes.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "tools/markers/marker_feed.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/connection/connection.h"
#include "tools/voxelctl/process/interrupt.h"

namespace voxeld::voxelctl {

struct FeedShowing {
  std::string source;               // whom it follows, for people
  std::string channel = "channel";  // what it is subscribed to, one of them, for people
  std::string layer;
  std::string client_name;
  bool reconnect = true;  // waits for a server that has gone; else that is the end
};

// Until an interrupt, which is no error; the feed's status when it ends, the session's (Unavailable) when that does. Each update is
// one commit. What cannot be read is counted and told, and the rest goes on. With --json a line when it is connected, one for each of the
// feed's news, a line of counts at most each second while messages come, and one at the end.
absl::Status ShowFeed(const FeedShowing& showing, markers::MarkerFeed& feed, Connection& connection,
                      Interrupt& interrupt, Console& console);

// With a message that is fit for a terminal.
absl::Status Escaped(const absl::Status& status);

}  // namespace voxeld::voxelctl
