// voxelctl doctor: what of this machine keeps voxeld from its work, and the command that mends it. Needs no daemon.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/voxelctl/commands/console.h"
#include "tools/voxelctl/doctor/machine.h"

namespace voxeld::voxelctl {

struct Finding {
  enum class State : uint8_t {
    kGood,
    kNote,  // works, though not as well as it might
    kBad,   // something will not work
  };
  std::string what;  // "usb", "udev", "usbfs", "cuda", "port"
  State state = State::kGood;
  std::string text;  // what there is; of devices what they say of themselves, not escaped
  std::string fix;   // a command; empty: nothing to mend
};

std::vector<Finding> Examine(const Machine& machine);

// FailedPrecondition if something is bad, after all has been told.
absl::Status Doctor(const Machine& machine, Console& console);

}  // namespace voxeld::voxelctl
