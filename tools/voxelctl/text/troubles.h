// Lists the problems that a server reports about itself.
#pragma once

#include <string>
#include <vector>

#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// Returns a line for each problem, in the server's words, escaped for a terminal: unreachable
// addresses, grants, configuration, state, assets, memory. Displays are not included, because they
// report their own. Empty without problems.
std::vector<std::string> Troubles(const v1::Stats& stats);

}  // namespace voxeld::voxelctl
