// Reads the daemon's configuration again while it runs. What is wrong in it changes nothing at all: the one in
// force stays, and trouble() says why. What only a restart changes is told, and left as it is: of it, what takes opening a
// device or a port to find out is not found out. The file is the one that was read at the start; that it has gone is wrong too.
//
// Taken while running: log.level, log.max_lines_per_second, security.grants and the scopes beside it, and of a
// display view, view_box and power_limit. A display's setting that the file does not change stays as clients
// have set it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/config/command_line.h"
#include "daemon/config/config.h"
#include "daemon/core/core.h"
#include "daemon/log/logger.h"
#include "daemon/pipeline/display_settings.h"
#include "daemon/reload/changes.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::reload {

struct NamedUpdate {
  std::string name;  // a display's
  DisplayUpdate update;
};

class Reloader {
 public:
  // Who is told of what changes; all outlive this.
  struct Parts {
    access::Access& access;
    Core& core;
    Logger& log;
  };

  // `in_force` is what the file, the command line over it, and `environment` said at the start.
  Reloader(Config in_force, CommandLine command_line, Environment environment, const Parts& parts);

  // Waits for the core. One thread at a time. Answers what changed, or why nothing did: the message has every
  // fault of the file, one a line. Both are in the log.
  absl::StatusOr<Changes> Reload();

  // Thread-safe. Why the last Reload changed nothing, in one line; empty: it did, or there was none.
  std::string trouble() const;

 private:
  absl::StatusOr<Config> Read() const;
  absl::StatusOr<Changes> Take(const Config& wanted);
  // Gives each display of `wanted`, which are those in force, its settings. `undo`: what takes that back.
  absl::Status TakeDisplays(const Config& wanted, std::vector<NamedUpdate>* undo);

  Config in_force_;
  const CommandLine command_line_;
  const Environment environment_;
  Parts parts_;
  mutable sync::Mutex mutex_;
  std::string trouble_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::reload
