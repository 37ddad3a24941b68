// The arguments of demo and their checks. Within this folder, errors are thrown (UsageError).
#pragma once

#include <string>
#include <vector>

#include "tools/voxelctl/cli/options.h"

namespace CLI {
class App;
}

namespace voxeld::voxelctl {

// References passed in live as long as the app.
void AddDemoOptions(CLI::App* command, DemoOptions* options);
// `plain` are the scenes after "--".
DemoOptions ReadDemoOptions(DemoOptions options, const std::vector<std::string>& plain);

}  // namespace voxeld::voxelctl
