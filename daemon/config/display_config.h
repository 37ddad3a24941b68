// The configuration of one display, from the file or from `--display NAME=DRIVER[,k=v…]`.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::daemon {

struct DisplayConfig {
  std::string name, driver;
  std::map<std::string, std::string> options;  // options of the driver, which checks them
  std::string source;                          // where the display was configured, for messages
  bool operator==(const DisplayConfig&) const = default;
};

// Requires 1 to 64 of a–z, A–Z, 0–9, '-', '_' and '.', beginning with a letter or digit. Errors:
// InvalidArgument.
absl::Status CheckDisplayName(std::string_view name);

// Parses text such as "rotor=simulated,geometry=rotor,size=128x64". Errors: InvalidArgument with
// the remedy.
absl::StatusOr<DisplayConfig> ParseDisplayOption(std::string_view text);

}  // namespace voxeld::daemon
