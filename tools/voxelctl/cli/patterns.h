// Test patterns by the names that they have on the command line.
#pragma once

#include <string>
#include <vector>

#include "tools/voxelctl/cli/argument_checks.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// With none, the scene again.
const Choices<v1::TestPattern>& Patterns();

// "axes", "corners", …: without none.
std::vector<std::string> PatternNames();

}  // namespace voxeld::voxelctl
