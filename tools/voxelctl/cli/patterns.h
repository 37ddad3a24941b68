// Test patterns by their names on the command line.
#pragma once

#include <string>
#include <vector>

#include "tools/voxelctl/cli/argument_checks.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// Includes none, which shows the scene again.
const Choices<v1::TestPattern>& Patterns();

// Returns "axes", "corners", …, without none.
std::vector<std::string> PatternNames();

}  // namespace voxeld::voxelctl
