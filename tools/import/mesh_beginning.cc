#include "tools/import/mesh_beginning.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/import/nesting.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kMostFileBytes = uint64_t{512} << 20;
constexpr size_t kHead = 4096;

struct Beginning {
  absl::string_view extension;
  std::vector<absl::string_view> at_front;  // one of these must be at the beginning, or
  absl::string_view within;                 // this must be within the first 4096 bytes
  absl::string_view expected;
};

// Libraries recurse into nested elements. People and programs nest about ten deep.
constexpr int kMostNesting = 200;

int NestingOf(const SourceFile& file) {
  const absl::string_view text = file.bytes;
  if (file.extension == "dae") return ElementDepth(text);
  if (file.extension == "ifc") return BracketDepth(text, '\'');
  if (file.extension == "bvh" || absl::StartsWith(text, ";")) return BracketDepth(text, '"');
  // All other text formats.
  if (text.substr(0, kHead).find('\0') != absl::string_view::npos) return 0;
  return std::max(
      absl::StartsWith(absl::StripLeadingAsciiWhitespace(text), "<") ? ElementDepth(text) : 0,
      BracketDepth(text, '"'));
}

// Removes the next number from the front of `text`, after whitespace and comments. Returns: the
// number; 0 for a word that does not begin with a digit; UINT64_MAX if the number is too large.
uint64_t TakeCount(absl::string_view* text) {
  while (!text->empty()) {
    if (text->front() == '#') {
      text->remove_prefix(std::min(text->find('\n'), text->size()));
    } else if (absl::ascii_isspace(static_cast<unsigned char>(text->front()))) {
      text->remove_prefix(1);
    } else {
      break;
    }
  }
  uint64_t value = 0;
  while (!text->empty() && absl::ascii_isdigit(static_cast<unsigned char>(text->front()))) {
    const auto digit = static_cast<uint64_t>(text->front() - '0');
    value = value > (UINT64_MAX - digit) / 10 ? UINT64_MAX : value * 10 + digit;
    text->remove_prefix(1);
  }
  // Skips the rest of a word that is not a number.
  while (!text->empty() && !absl::ascii_isspace(static_cast<unsigned char>(text->front())))
    text->remove_prefix(1);
  return value;
}

// The library allocates all vertices and faces that an OFF file declares before it reads the first
// one. It does not report missing corners.
absl::Status CheckOff(const SourceFile& file, OffColors* colors) {
  absl::string_view text = file.bytes;
  // The magic is [ST][C][N][4][n]OFF; the counts may follow immediately.
  bool is_plain = true;
  for (const absl::string_view option : {"ST", "C", "N", "4"})
    is_plain &= !absl::ConsumePrefix(&text, option);
  const bool has_dimension = absl::ConsumePrefix(&text, "n");
  absl::ConsumePrefix(&text, "OFF");
  if (has_dimension) TakeCount(&text);
  const uint64_t vertices = TakeCount(&text), faces = TakeCount(&text);
  // The shortest vertex is "0 0 0" and the shortest face "1 0", each with a line end.
  const uint64_t bytes = file.bytes.size();
  if (vertices > bytes / 6 || faces > bytes / 4) {
    return FileError(file,
                     absl::StrCat("declares ", vertices, " vertices and ", faces,
                                  " faces but has only ", bytes, " bytes"),
                     "the file is truncated or damaged");
  }
  // Skips the number of edges, and the rest of its line.
  text.remove_prefix(std::min(text.find_first_of("\r\n"), text.size()));
  uint64_t lines = 0;
  for (absl::string_view line : absl::StrSplit(text, absl::ByAnyChar("\r\n"))) {
    line = absl::StripAsciiWhitespace(line.substr(0, line.find('#')));
    if (line.empty() || ++lines > vertices + faces) continue;
    const std::vector<absl::string_view> words =
        absl::StrSplit(line, absl::ByAnyChar(" \t"), absl::SkipEmpty());
    if (lines <= vertices) {
      colors->vertices += is_plain && !has_dimension && words.size() >= 6 ? 1 : 0;
      continue;
    }
    uint64_t corners = 0;
    if (!absl::SimpleAtoi(words[0], &corners) || corners >= words.size()) {
      return FileError(
          file,
          absl::StrCat("face ", lines - vertices, " of ", faces, " has ", words.size() - 1,
                       " corners of ", EscapeForTerminal(words[0].substr(0, 24))),
          "the file is truncated or damaged");
    }
    colors->faces += words.size() > corners + 1 ? 1 : 0;
  }
  if (lines < vertices + faces) {
    return FileError(file,
                     absl::StrCat("has no line for face ",
                                  lines < vertices ? 1 : lines - vertices + 1, " of ", faces),
                     "the file is truncated or damaged");
  }
  return absl::OkStatus();
}

// Checks the numbers of the entities that a STEP file defines ("#12=…") or refers to ("#12"),
// outside strings and comments. The library dereferences a null pointer for a reference to a
// missing entity.
absl::Status CheckStepReferences(const SourceFile& file) {
  absl::string_view text = file.bytes;
  std::vector<uint64_t> defined, used;
  for (size_t at = 0; at < text.size(); ++at) {
    if (text[at] == '\'') {
      at = std::min(text.find('\'', at + 1), text.size());
    } else if (text.substr(at, 2) == "/*") {
      at = std::min(text.find("*/", at + 2), text.size());
    } else if (text[at] == '#') {
      absl::string_view rest = text.substr(at + 1);
      uint64_t number = 0;
      size_t digits = 0;
      while (digits < rest.size() && digits < 19 &&
             absl::ascii_isdigit(static_cast<unsigned char>(rest[digits])))
        number = number * 10 + static_cast<uint64_t>(rest[digits++] - '0');
      rest = absl::StripLeadingAsciiWhitespace(rest.substr(digits));
      if (digits > 0) (absl::StartsWith(rest, "=") ? defined : used).push_back(number);
    }
  }
  std::sort(defined.begin(), defined.end());
  for (const uint64_t number : used) {
    if (!std::binary_search(defined.begin(), defined.end(), number)) {
      return FileError(file, absl::StrCat("refers to #", number, ", which it does not define"),
                       "the file is truncated or damaged");
    }
  }
  return absl::OkStatus();
}

}  // namespace

OffColors CountOffColors(const SourceFile& file) {
  OffColors colors;
  CheckOff(file, &colors).IgnoreError();
  return colors;
}

absl::Status CheckMeshBeginning(const SourceFile& file) {
  if (file.bytes.size() > kMostFileBytes) {
    return FileError(file, absl::StrCat("has ", file.bytes.size(), " bytes"),
                     absl::StrCat("meshes of this kind of at most ", kMostFileBytes, " are read"));
  }
  const Beginning beginnings[] = {
      {"off", {}, "OFF", "a file that begins with \"OFF\" is expected"},
      {"fbx", {"Kaydara FBX Binary"}, "FBX", "binary or ASCII FBX is expected"},
      {"3mf", {"PK\x03\x04"}, "", "a ZIP archive, as 3MF is, is expected"},
      // A byte order mark means UTF-16, in which the words cannot be found as plain bytes.
      {"dae", {"\xff\xfe", "\xfe\xff"}, "<COLLADA", "XML of <COLLADA> is expected"},
      {"blend", {"BLENDER", "\x1f\x8b"}, "", "a Blender file is expected"},
      {"ifc", {"ISO-10303-21"}, "", "a STEP file (\"ISO-10303-21\") is expected"},
      {"bvh", {"HIERARCHY"}, "HIERARCHY", "a file that begins with \"HIERARCHY\" is expected"},
  };
  const absl::string_view head = absl::string_view(file.bytes).substr(0, kHead);
  for (const Beginning& b : beginnings) {
    if (b.extension != file.extension) continue;
    bool good = !b.within.empty() && absl::StrContains(head, b.within);
    for (const absl::string_view front : b.at_front) good |= absl::StartsWith(head, front);
    if (!good)
      return FileError(file, absl::StrCat("is ", DescribeContents(file.bytes)), b.expected);
  }
  if (file.extension == "off") {
    OffColors ignored;
    if (absl::Status status = CheckOff(file, &ignored); !status.ok()) return status;
  }
  if (file.extension == "ifc") {
    if (absl::Status status = CheckStepReferences(file); !status.ok()) return status;
  }
  if (const int depth = NestingOf(file); depth > kMostNesting) {
    return FileError(file, absl::StrCat("is nested ", depth, " levels deep"),
                     absl::StrCat("at most ", kMostNesting, " are read"));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
