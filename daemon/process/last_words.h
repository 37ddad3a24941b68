// A line on standard error where nothing may be allocated, locked or waited for: in handlers of signals, and without memory.
#pragma once

#include <string_view>

namespace voxeld::daemon {

// Left out where nobody reads it. Async-signal-safe; `line` ends with a newline. Keeps errno.
void SayAtOnce(std::string_view line) noexcept;

}  // namespace voxeld::daemon
