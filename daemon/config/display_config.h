// One display as it is asked for, from the file or from `--display NAME=DRIVER[,k=v…]`.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::daemon {

struct DisplayConfig {
  std::string name, driver;
  std::map<std::string, std::string> options;  // the driver's own; it checks them
  std::string source;                          // where it was asked for, for messages
  bool operator==(const DisplayConfig&) const = default;
};

// 1 to 64 of a–z, A–Z, 0–9, '-', '_', '.'; beginning with a letter or digit.
absl::Status CheckDisplayName(std::string_view name);

// "rotor=simulated,geometry=rotor,size=128x64". InvalidArgument says what would be right.
absl::StatusOr<DisplayConfig> ParseDisplayOption(std::string_view text);

}  // namespace voxeld::daemon
