// Reloads the daemon's configuration while it runs. An invalid configuration changes nothing: the
// current one stays in force and trouble() reports the reason. Changes that need a restart are
// reported and not applied; faults in them that only opening a device or port would reveal are not
// detected. The file is the one that was read at the start; it is an error if it no longer exists.
//
// Applied while running: log.level, log.max_lines_per_second, security.grants and the scopes beside
// it, and view, view_box and power_limit of a display. A display's setting that the file does not
// change keeps the value that clients have set.
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
  std::string name;  // name of the display
  DisplayUpdate update;
};

class Reloader {
 public:
  // The objects that are changed. All must outlive the Reloader.
  struct Parts {
    access::Access& access;
    Core& core;
    Logger& log;
  };

  // `in_force` is the configuration at the start, made from the file, the command line and
  // `environment`.
  Reloader(Config in_force, CommandLine command_line, Environment environment, const Parts& parts);

  // Blocks until the core has answered. Call from one thread at a time. Returns: the changes.
  // Errors: a message that lists every fault of the file, one per line. Both are logged.
  absl::StatusOr<Changes> Reload();

  // Thread-safe. Returns: in one line, why the last Reload failed; empty if it succeeded or there
  // was none.
  std::string trouble() const;

 private:
  absl::StatusOr<Config> Read() const;
  absl::StatusOr<Changes> Take(const Config& wanted);
  // Applies the settings of the displays in `wanted`, which must be the current displays. `undo`:
  // receives the updates that restore the previous settings.
  absl::Status TakeDisplays(const Config& wanted, std::vector<NamedUpdate>* undo);

  Config in_force_;
  const CommandLine command_line_;
  const Environment environment_;
  Parts parts_;
  mutable sync::Mutex mutex_;
  std::string trouble_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::reload
