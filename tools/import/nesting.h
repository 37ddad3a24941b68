// How deep text is nested, before a library that recurses reads it.
#pragma once

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// Returns: the greatest depth of XML elements within each other. Unspecified if `text` is not XML; UTF-16 of ASCII is read as well.
int ElementDepth(absl::string_view text);

// Returns: the greatest depth of (), [] and {} within each other, outside strings in `quote`.
int BracketDepth(absl::string_view text, char quote);

}  // namespace voxeld::voxelctl
