#include "tools/import/mesh_beginning.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "tools/import/nesting.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kMostFileBytes = uint64_t{512} << 20;
constexpr size_t kHead = 4096;

struct Beginning {
  absl::string_view extension;
  std::vector<absl::string_view> at_front;  // one of these stands there; or
  absl::string_view within;                 // this within the first 4096 bytes
  absl::string_view expected;
};

// Libraries recurse on what is nested. People and programs nest some ten deep.
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

// Removes the next number from the front of `text`, after whitespace and comments, and returns it: 0 for a word that does not begin with a
// digit, UINT64_MAX for a number that is too large.
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
  // The rest of a word that is not a number.
  while (!text->empty() && !absl::ascii_isspace(static_cast<unsigned char>(text->front())))
    text->remove_prefix(1);
  return value;
}

// The library allocates all the vertices and faces that an OFF file declares before it reads the first one.
absl::Status CheckOffCounts(const SourceFile& file) {
  absl::string_view text = file.bytes;
  // [ST][C][N][4][n]OFF; the counts may follow at once.
  for (const absl::string_view option : {"ST", "C", "N", "4"}) absl::ConsumePrefix(&text, option);
  const bool has_dimension = absl::ConsumePrefix(&text, "n");
  absl::ConsumePrefix(&text, "OFF");
  if (has_dimension) TakeCount(&text);
  const uint64_t vertices = TakeCount(&text), faces = TakeCount(&text);
  // "0 0 0" is the shortest vertex, "1 0" the shortest face, each with the end of its line.
  const uint64_t bytes = file.bytes.size();
  if (vertices > bytes / 6 || faces > bytes / 4) {
    return FileError(file,
                     absl::StrCat("declares ", vertices, " vertices and ", faces,
                                  " faces but has only ", bytes, " bytes"),
                     "the file is truncated or damaged");
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckMeshBeginning(const SourceFile& file) {
  if (file.bytes.size() > kMostFileBytes) {
    return FileError(file, absl::StrCat("has ", file.bytes.size(), " bytes"),
                     absl::StrCat("meshes of this kind of at most ", kMostFileBytes, " are read"));
  }
  const Beginning beginnings[] = {
      {"off", {}, "OFF", "a file that begins with \"OFF\" is expected"},
      {"fbx", {"Kaydara FBX Binary"}, "FBX", "binary or ASCII FBX is expected"},
      {"3mf", {"PK\x03\x04"}, "", "a ZIP archive, as 3MF is, is expected"},
      // A byte order mark: UTF-16, where words are not to be found as they stand.
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
    if (absl::Status status = CheckOffCounts(file); !status.ok()) return status;
  }
  if (const int depth = NestingOf(file); depth > kMostNesting) {
    return FileError(file, absl::StrCat("is nested ", depth, " levels deep"),
                     absl::StrCat("at most ", kMostNesting, " are read"));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
