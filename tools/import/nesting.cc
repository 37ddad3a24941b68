#include "tools/import/nesting.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <string>

#include "absl/strings/match.h"

namespace voxeld::voxelctl {

int ElementDepth(absl::string_view text) {
  // UTF-16 text of ASCII characters has a NUL beside each character.
  std::string plain;
  if (text.find('\0') != absl::string_view::npos) {
    std::copy_if(text.begin(), text.end(), std::back_inserter(plain),
                 [](char c) { return c != 0; });
    text = plain;
  }
  const auto skip = [&text](size_t at, absl::string_view end) {
    const size_t found = text.find(end, at);
    return found == absl::string_view::npos ? text.size() : found + end.size();
  };
  int depth = 0, deepest = 0;
  for (size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const absl::string_view rest = text.substr(at);
    if (absl::StartsWith(rest, "<!--")) {
      at = skip(at + 4, "-->");
    } else if (absl::StartsWith(rest, "<![CDATA[")) {
      at = skip(at + 9, "]]>");
    } else if (absl::StartsWith(rest, "<?") || absl::StartsWith(rest, "<!")) {
      at = skip(at + 2, ">");
    } else if (absl::StartsWith(rest, "</")) {
      depth = std::max(0, depth - 1);
      at += 2;
    } else {
      // Skips to the end of the tag; its attributes may contain '>'.
      size_t end = at + 1;
      while (end < text.size() && text[end] != '>') {
        if (text[end] == '"' || text[end] == '\'') end = text.find(text[end], end + 1);
        if (end < text.size()) ++end;
      }
      end = std::min(end, text.size());
      deepest = std::max(deepest, depth + 1);
      if (text[end - 1] != '/') ++depth;
      at = end;
    }
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
