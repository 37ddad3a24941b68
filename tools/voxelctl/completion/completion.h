// Generates scripts with which shells complete the command line.
#pragma once

#include <string>

#include "daemon/usage/command_table.h"

namespace voxeld::voxelctl {

enum class Shell : uint8_t { kBash, kZsh, kFish };

// Returns the script. It contains all commands, options and fixed values, and calls `voxelctl
// __complete KIND` for values that are known only at run time: displays, layers, entities, owners,
// profiles. It is meant to be sourced, or installed where the shell looks for it.
std::string CompletionScript(Shell shell, const usage::CommandEntry& program);

}  // namespace voxeld::voxelctl
