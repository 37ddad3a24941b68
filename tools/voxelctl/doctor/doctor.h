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

// `server`: the address that was asked for, a TCP port of this machine; empty: the usual one.
// FailedPrecondition if something is bad, after all has been told; InvalidArgument: `server` is elsewhere.
absl::Status Doctor(Machine machine, const std::string& server, Console& console);

}  // namespace voxeld::voxelctl
