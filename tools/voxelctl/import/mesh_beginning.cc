#include "tools/voxelctl/import/mesh_beginning.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/nesting.h"

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

// The library makes room for as many vertices and faces as an OFF file claims before it reads one.
absl::Status CheckOffCounts(const SourceFile& file) {
  uint64_t counts[2] = {};  // vertices, faces
  size_t found = 0;
  for (absl::string_view line : absl::StrSplit(file.bytes, '\n')) {
    line = line.substr(0, line.find('#'));
    for (const absl::string_view word : absl::StrSplit(line, absl::ByAnyChar(" \t\r"))) {
      // What is no number is the keyword, such as OFF or COFF.
      if (found < 2 && absl::SimpleAtoi(word, &counts[found])) ++found;
    }
    if (found == 2) break;
  }
  // "0 0 0" is the shortest vertex, "1 0" the shortest face, each with the end of its line.
  const uint64_t bytes = file.bytes.size();
  if (counts[0] > bytes / 6 || counts[1] > bytes / 4) {
    return FileError(file,
                     absl::StrCat("claims ", counts[0], " vertices and ", counts[1],
                                  " faces, for which its ", bytes, " bytes are too few"),
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
