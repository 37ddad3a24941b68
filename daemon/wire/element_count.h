// How many elements a message holds, before it is parsed: parsing makes an object of each, and two
// bytes are enough for one, so a message of allowed size could ask for a hundred times its size.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace voxeld::daemon::wire {

// Occurrences of the last field of `path` within submessages of the fields before it. What is
// malformed ends the counting: the parser will refuse it.
uint64_t CountElements(std::span<const std::string_view> slices, std::span<const int> path);

}  // namespace voxeld::daemon::wire
