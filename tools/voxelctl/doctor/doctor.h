// voxelctl doctor: checks this machine for problems that affect voxeld, and prints the command that
// fixes each. Needs no daemon.
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
    kNote,  // works, but could work better
    kBad,   // something will not work
  };
  std::string what;  // "usb", "udev", "usbfs", "cuda", "port"
  State state = State::kGood;
  std::string text;  // the finding; text that comes from devices is not escaped
  std::string fix;   // a command; empty: nothing to fix
};

std::vector<Finding> Examine(const Machine& machine);

// `server` is the given address, a TCP port of this machine; empty: the default one. Errors:
// FailedPrecondition if something is bad, after everything was reported; InvalidArgument if
// `server` is another machine.
absl::Status Doctor(Machine machine, const std::string& server, Console& console);

}  // namespace voxeld::voxelctl
