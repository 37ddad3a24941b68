// Compares two configurations key by key.
#pragma once

#include <string>
#include <vector>

#include "daemon/config/config.h"

namespace voxeld::daemon::reload {

struct Changes {
  // Keys such as "log.level" or "display.rotor.view", in the order of the file's sections, then the
  // displays by name. An added or removed display is "display.rotor".
  std::vector<std::string> at_once;     // applied while the daemon runs
  std::vector<std::string> at_restart;  // applied at the next start
  // Whether `at_once` contains keys that grant permissions. If a key that decides who can connect
  // needs a restart, these keys wait for it too.
  bool access = false;
};

Changes Compare(const Config& in_force, const Config& wanted);

// Returns: `in_force` with the values of `wanted` for all keys that can change while the daemon
// runs.
Config Taken(const Config& in_force, const Config& wanted);

}  // namespace voxeld::daemon::reload
