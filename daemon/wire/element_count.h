// Counts the elements of a message before it is parsed. Parsing creates an object for each, and an
// element can have as little as two bytes, so a message of valid size could require a hundred times
// its size.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace voxeld::daemon::wire {

// Returns: the number of occurrences of the last field of `path` in submessages of the preceding
// fields. Stops counting at malformed data, which the parser will reject.
uint64_t CountElements(std::span<const std::string_view> slices, std::span<const int> path);

}  // namespace voxeld::daemon::wire
