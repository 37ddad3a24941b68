// What is different between two configurations, key by key.
#pragma once

#include <string>
#include <vector>

#include "daemon/config/config.h"

namespace voxeld::daemon::reload {

struct Changes {
  // Keys as "log.level" or "display.rotor.view", in the order of the file's sections, then the displays by
  // name. A display that came or went is "display.rotor".
  std::vector<std::string> at_once;     // a running daemon takes them
  std::vector<std::string> at_restart;  // it does not
  // Of at_once some say who may do what. They wait for the restart with what says who can come at all.
  bool access = false;
};

Changes Compare(const Config& in_force, const Config& wanted);

// `in_force` with what `wanted` says of the keys that a running daemon takes.
Config Taken(const Config& in_force, const Config& wanted);

}  // namespace voxeld::daemon::reload
