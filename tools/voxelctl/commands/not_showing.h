// Displays on which nothing can be seen at the moment.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/voxelctl/connection/connection.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// Returns: a sentence for each display that does not show the scene, with its state and the reason. Fit for a terminal.
std::vector<std::string> NotShowing(const v1::ListDisplaysResponse& displays);

// Asks the server about the entities `ids` of a layer. Returns: a sentence for each of which nothing can be seen on any display, with the
// reason on the first; fit for a terminal. Each answer costs the server a few draws, so what it does not answer within 1.5 s in all is passed
// over.
std::vector<std::string> Unseen(uint64_t owner, const std::string& layer,
                                const std::vector<std::string>& ids, Connection& connection);

}  // namespace voxeld::voxelctl
