// Writes a line to standard error without allocating, locking or blocking: for signal handlers and
// when memory has run out.
#pragma once

#include <string_view>

namespace voxeld::daemon {

// Drops the line if it cannot be written at once. Async-signal-safe; preserves errno. `line` must
// end with a newline.
void SayAtOnce(std::string_view line) noexcept;

}  // namespace voxeld::daemon
