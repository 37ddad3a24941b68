// Scripts by which shells complete the command line, from what it has.
#pragma once

#include <string>

#include "daemon/usage/command_table.h"

namespace voxeld::voxelctl {

enum class Shell : uint8_t { kBash, kZsh, kFish };

// Knows all commands, options and what values may be; asks `voxelctl __complete KIND` for what is only known when
// it is asked: displays, layers, entities, owners, profiles. To be sourced, or to lie where the shell looks for it.
std::string CompletionScript(Shell shell, const usage::CommandEntry& program);

}  // namespace voxeld::voxelctl
