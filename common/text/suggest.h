// "Did you mean …?"
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

// Single characters to add, drop, change, or swap with their neighbour, to make one of the other;
// case counts not.
size_t EditDistance(std::string_view a, std::string_view b);

// The one of `known` that `wrong` is nearest to or begins,
// if it is near enough to be meant; else empty.
std::string Nearest(std::string_view wrong, const std::vector<std::string>& known);

// "; did you mean X?", or "; known are …" if nothing is near.
std::string Suggestion(std::string_view wrong, const std::vector<std::string>& known);

}  // namespace voxeld
