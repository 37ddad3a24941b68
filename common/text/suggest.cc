#include "common/text/suggest.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld {

size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> before_last, last(b.size() + 1), row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    before_last = last;
    last = row;
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const auto same = [&](size_t x, size_t y) {
        return absl::ascii_tolower(a[x]) == absl::ascii_tolower(b[y]);
      };
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (same(i - 1, j - 1) ? 0 : 1)});
      if (i > 1 && j > 1 && same(i - 1, j - 2) && same(i - 2, j - 1))
        row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
  }
  return row[b.size()];
}

std::string Nearest(std::string_view wrong, const std::vector<std::string>& known) {
  std::string nearest;
  size_t least = 1 + wrong.size() / 6;  // a suggestion that needs more edits would be a guess
  if (wrong.size() > 64) return nearest;
  for (const std::string& name : known) {
    const size_t distance = EditDistance(wrong, name);
    if (distance <= least && distance < name.size()) {
      nearest = name;
      least = distance - (distance > 0 ? 1 : 0);
    }
  }
  if (!nearest.empty() || wrong.empty()) return nearest;
  const std::string begin = absl::AsciiStrToLower({wrong.data(), wrong.size()});
  for (const std::string& name : known) {
    if (absl::StartsWith(name, begin)) return name;
  }
  return nearest;
}

std::string Suggestion(std::string_view wrong, const std::vector<std::string>& known) {
  const std::string nearest = Nearest(wrong, known);
  if (!nearest.empty()) return absl::StrCat("; did you mean ", nearest, "?");
  return absl::StrCat("; known are ", absl::StrJoin(known, ", "));
}

}  // namespace voxeld
