// Names from clients in messages for people.
#pragma once

#include <string>
#include <string_view>

namespace voxeld::daemon {

// Quoted, with what is not printable escaped, and cut to a length fit for a message. Stays valid UTF-8.
std::string Quoted(std::string_view text);

}  // namespace voxeld::daemon
