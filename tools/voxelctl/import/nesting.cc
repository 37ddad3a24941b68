#include "tools/voxelctl/import/nesting.h"

#include <algorithm>
#include <cstddef>

namespace voxeld::voxelctl {

int ElementDepth(absl::string_view text) {
  int depth = 0, deepest = 0;
  char before = 0;      // the character before, but for NULs
  bool in_tag = false;  // of an element's beginning
  for (const char c : text) {
    if (c == '\0') continue;
    if (before == '<' && c == '/') {
      depth = std::max(0, depth - 1);
    } else if (before == '<' && c != '?' && c != '!') {
      deepest = std::max(deepest, ++depth);
      in_tag = true;
    } else if (c == '>' && in_tag) {
      if (before == '/') --depth;
      in_tag = false;
    }
    before = c;
  }
  return deepest;
}

int BracketDepth(absl::string_view text, char quote) {
  int depth = 0, deepest = 0;
  bool in_string = false;
  for (const char c : text) {
    if (c == quote) in_string = !in_string;
    if (in_string) continue;
    if (c == '(' || c == '[' || c == '{') deepest = std::max(deepest, ++depth);
    if (c == ')' || c == ']' || c == '}') depth = std::max(0, depth - 1);
  }
  return deepest;
}

}  // namespace voxeld::voxelctl
