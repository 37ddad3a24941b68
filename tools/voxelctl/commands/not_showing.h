// Finds displays on which nothing is visible at the moment.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/voxelctl/connection/connection.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::voxelctl {

// Returns: a sentence for each display that does not show the scene, with its state and the reason.
// Escaped for a terminal.
std::vector<std::string> NotShowing(const v1::ListDisplaysResponse& displays);

// Asks the server about the entities `ids` of a layer. Returns: a sentence for each entity that is
// invisible on all displays, with the reason on the first, escaped for a terminal. Each answer
// costs the server a few draws, so entities for which there is no answer within 1.5 s in total are
// skipped.
std::vector<std::string> Unseen(uint64_t owner, const std::string& layer,
                                const std::vector<std::string>& ids, Connection& connection);

}  // namespace voxeld::voxelctl
