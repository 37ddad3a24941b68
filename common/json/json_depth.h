// How deep JSON nests, before it is parsed: what nobody vouches for may be deeper than whoever walks through it bears.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace voxeld {

inline constexpr int kMaxJsonDepth = 64;

// How deep brackets nest outside strings; does not recurse. Of what is no JSON, some number.
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
