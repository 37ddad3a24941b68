// Formats clients' names for messages.
#pragma once

#include <string>
#include <string_view>

namespace voxeld::daemon {

// Returns: the text quoted, with unprintable characters escaped, and shortened for a message. Stays
// valid UTF-8.
std::string Quoted(std::string_view text);

}  // namespace voxeld::daemon
