// Strings that others chose, made fit for a terminal.
#pragma once

#include <string>

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Control characters (C0, DEL, C1), bytes that are not UTF-8, line separators and the marks that
// turn the direction of writing become \xNN or \u{N}; a backslash is doubled. What is left cannot
// move a cursor or set a title.
std::string EscapeForTerminal(absl::string_view text);

// Whether all of it is UTF-8, as protobuf's strings must be.
bool IsUtf8(absl::string_view text);

}  // namespace voxeld::voxelctl
