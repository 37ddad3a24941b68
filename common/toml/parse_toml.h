// Parses untrusted TOML. toml++ recurses once for each part of a dotted key and each level of nesting, so both are bounded
// before it sees the text.
#pragma once

#include <toml++/toml.h>

#include <cstddef>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld {

// Hand-written files stay far below these limits.
struct TomlLimits {
  size_t max_bytes = size_t{16} << 20;
  size_t max_key_parts = 8;  // of a dotted key or a table's header
  size_t max_depth = 16;     // of arrays and inline tables within each other
};

// Returns: the document, whose nodes remember their lines. `name` stands for the text in messages.
// Errors: InvalidArgument, "NAME:LINE:COLUMN: what is wrong", in printable text.
// Stack: bounded by the limits, whatever the text.
absl::StatusOr<toml::table> ParseToml(std::string_view text, const std::string& name,
                                      const TomlLimits& limits = {});

}  // namespace voxeld
