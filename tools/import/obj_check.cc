#include <charconv>
#include <cstdint>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/import/mesh_checks.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {
namespace {

constexpr absl::string_view kExpected =
    "a Wavefront OBJ is text with lines such as \"v 1 2 3\" and \"f 1 2 3\"";

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// The next word of a line, taken off its front; empty at its end.
absl::string_view TakeWord(absl::string_view* line) {
  size_t begin = 0;
  while (begin < line->size() && IsBlank((*line)[begin])) ++begin;
  size_t end = begin;
  while (end < line->size() && !IsBlank((*line)[end])) ++end;
  const absl::string_view word = line->substr(begin, end - begin);
  line->remove_prefix(end);
  return word;
}

// Calls visit(number, line) with each line, those that end in a backslash joined to their next.
template <typename Visit>
absl::Status ForEachLine(absl::string_view text, Visit visit) {
  std::string joined;
  for (int64_t number = 1; !text.empty(); ++number) {
    const size_t end = std::min(text.find('\n'), text.size());
    absl::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    while (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (!line.empty() && line.back() == '\\') {
      line.remove_suffix(1);
      absl::StrAppend(&joined, line, " ");
      continue;
    }
    if (!joined.empty()) {
      absl::StrAppend(&joined, line);
      line = joined;
    }
    absl::Status status = visit(number, line);
    if (!status.ok()) return status;
    joined.clear();
  }
  return absl::OkStatus();
}

absl::Status CheckReference(const SourceFile& file, int64_t number, absl::string_view word,
                            int64_t vertices_so_far, int64_t vertices) {
  const absl::string_view index = word.substr(0, word.find('/'));
  int64_t value = 0;
  const auto parsed = std::from_chars(index.data(), index.data() + index.size(), value);
  if (parsed.ec != std::errc() || parsed.ptr != index.data() + index.size()) {
    return FileError(file,
                     absl::StrCat("line ", number, " refers to vertex \"",
                                  EscapeForTerminal(index.substr(0, 24)), "\""),
                     "a vertex number is expected");
  }
  // Negative numbers count backwards from the line.
  if (value > 0 ? value > vertices : (value == 0 || -value > vertices_so_far)) {
    return FileError(
        file, absl::StrCat("line ", number, " refers to vertex ", value),
        absl::StrCat("the file has vertices 1 to ", vertices, ": it is truncated or damaged"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckObj(const SourceFile& file) {
  const absl::string_view text = file.bytes;
  if (absl::StartsWith(text, "\xff\xfe") || absl::StartsWith(text, "\xfe\xff")) {
    return FileError(file, "is UTF-16 text", "UTF-8 is read; convert it");
  }
  if (text.find('\0') != absl::string_view::npos) {
    return FileError(file, absl::StrCat("is ", DescribeContents(text)), kExpected);
  }
  int64_t vertices = 0;
  absl::Status status =
      ForEachLine(text, [&](int64_t number, absl::string_view line) -> absl::Status {
        if (TakeWord(&line) != "v") return absl::OkStatus();
        for (int i = 0; i < 3; ++i) {
          if (TakeWord(&line).empty()) {
            return FileError(file,
                             absl::StrCat("vertex ", vertices + 1, " in line ", number, " has ", i,
                                          i == 1 ? " coordinate" : " coordinates"),
                             "three are expected: the file is truncated or damaged");
          }
        }
        ++vertices;
        return absl::OkStatus();
      });
  if (!status.ok()) return status;
  if (vertices == 0) {
    return FileError(file, absl::StrCat("is ", DescribeContents(text), ", with no vertex"),
                     kExpected);
  }
  if (vertices > static_cast<int64_t>(kMaxModelVertices)) {
    return FileError(file, absl::StrCat("has ", vertices, " vertices"),
                     absl::StrCat("at most ", kMaxModelVertices, " are read"));
  }
  int64_t so_far = 0;
  return ForEachLine(text, [&](int64_t number, absl::string_view line) -> absl::Status {
    const absl::string_view word = TakeWord(&line);
    if (word == "v") ++so_far;
    if (word != "f" && word != "l" && word != "p") return absl::OkStatus();
    for (absl::string_view w = TakeWord(&line); !w.empty() && w.front() != '#';
         w = TakeWord(&line)) {
      absl::Status checked = CheckReference(file, number, w, so_far, vertices);
      if (!checked.ok()) return checked;
    }
    return absl::OkStatus();
  });
}

}  // namespace voxeld::voxelctl
