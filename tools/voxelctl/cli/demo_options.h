// The arguments of demo, and what these may be. Within this folder wrong ones are thrown (UsageError).
#pragma once

#include <string>
#include <vector>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}

namespace voxeld::voxelctl {

// What is given lives as long as the app.
void AddDemoOptions(CLI::App* command, DemoOptions* options);
// `plain`: scenes that stand behind --.
DemoOptions ReadDemoOptions(DemoOptions options, const std::vector<std::string>& plain);

}  // namespace voxeld::voxelctl
