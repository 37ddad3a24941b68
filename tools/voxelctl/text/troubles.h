// What a server says that is amiss with itself.
#pragma once

#include <string>
#include <vector>

#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// A line each, as the server words it, made fit for a terminal: who cannot reach it, its grants, its configuration, its
// state, its assets, its memory. Nothing of displays, which tell of themselves. Empty: all is well.
std::vector<std::string> Troubles(const v1::Stats& stats);

}  // namespace voxeld::voxelctl
