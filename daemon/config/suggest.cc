#include "daemon/config/suggest.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::daemon {
namespace {

// Damerau's distance with neighbours exchanged, three rows at a time.
size_t Distance(std::string_view a, std::string_view b) {
  std::vector<size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) last[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        row[j] = std::min(row[j], before[j - 2] + 1);
      }
    }
    before.swap(last);
    last.swap(row);
  }
  return last[b.size()];
}

}  // namespace

std::string Nearest(std::string_view wrong, const std::vector<std::string>& known) {
  constexpr size_t kLongest = 64;  // nothing known is longer, and the work is bounded
  std::string nearest;
  if (wrong.empty() || wrong.size() > kLongest) return nearest;
  size_t least = std::max<size_t>(1, wrong.size() / 3) + 1;
  for (const std::string& candidate : known) {
    const size_t distance = Distance(wrong, candidate);
    if (distance < least) {
      least = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

std::string Suggestion(std::string_view wrong, const std::vector<std::string>& known) {
  const std::string nearest = Nearest(wrong, known);
  if (!nearest.empty()) return absl::StrCat("; did you mean ", nearest, "?");
  return absl::StrCat("; known are ", absl::StrJoin(known, ", "));
}

}  // namespace voxeld::daemon
