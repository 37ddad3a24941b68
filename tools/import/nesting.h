// Measures how deep text is nested, before a recursive library reads it.
#pragma once

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Returns: the greatest nesting depth of XML elements. Unspecified if `text` is not XML. UTF-16 of
// ASCII is accepted too.
int ElementDepth(absl::string_view text);

// Returns: the greatest nesting depth of (), [] and {}, outside strings in `quote`.
int BracketDepth(absl::string_view text, char quote);

}  // namespace voxeld::voxelctl
