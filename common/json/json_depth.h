// Computes the nesting depth of JSON before it is parsed. Deeply nested, untrusted JSON can overflow the stack of recursive code.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace voxeld {

inline constexpr int kMaxJsonDepth = 64;

// Returns: the maximum nesting depth of brackets outside strings. Does not recurse. Unspecified if `text` is not valid JSON.
inline int JsonDepth(std::string_view text) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') {
        ++i;
      } else if (c == '"') {
        in_string = false;
      }
    } else if (c == '"') {
      in_string = true;
    } else if (c == '{' || c == '[') {
      deepest = std::max(deepest, ++depth);
    } else if (c == '}' || c == ']') {
      --depth;
    }
  }
  return deepest;
}

}  // namespace voxeld
