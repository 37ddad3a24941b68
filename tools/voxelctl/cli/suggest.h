// "Did you mean …?"
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Single characters to add, drop, change, or swap with their neighbour, to make one of the other;
// case counts not.
size_t EditDistance(absl::string_view a, absl::string_view b);

// The one of `known` that `wrong` is nearest to or begins, if it is near enough to be meant; else
// empty.
std::string Nearest(absl::string_view wrong, const std::vector<std::string>& known);

}  // namespace voxeld::voxelctl
