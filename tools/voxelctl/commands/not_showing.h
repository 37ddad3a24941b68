// Displays on which nothing can be seen at the moment.
#pragma once

#include <string>
#include <vector>

#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// Returns: a sentence for each display that does not show the scene, with its state and the reason. Fit for a terminal.
std::vector<std::string> NotShowing(const v1::ListDisplaysResponse& displays);

}  // namespace voxeld::voxelctl
