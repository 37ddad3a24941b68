#include <cstdint>
#include <cstring>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/mesh_checks.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kBinaryHeader = 84;
constexpr uint64_t kBinaryFacet = 50;

absl::Status CheckAscii(const SourceFile& file) {
  const absl::string_view text = file.bytes;
  if (text.find("facet") == absl::string_view::npos) {
    return FileError(file, "is ASCII STL without a facet", "at least one triangle is expected");
  }
  bool open = false;
  for (absl::string_view line : absl::StrSplit(text, '\n')) {
    line = absl::StripLeadingAsciiWhitespace(line);
    if (absl::StartsWithIgnoreCase(line, "solid")) open = true;
    if (absl::StartsWithIgnoreCase(line, "endsolid")) open = false;
  }
  if (open) return FileError(file, "ends without \"endsolid\"", "the file is truncated");
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckStl(const SourceFile& file) {
  const absl::string_view bytes = file.bytes;
  // A binary file may begin with "solid" too, so a size that fits decides first.
  uint32_t facets = 0;
  if (bytes.size() >= kBinaryHeader) std::memcpy(&facets, bytes.data() + 80, sizeof facets);
  const uint64_t announced = kBinaryHeader + kBinaryFacet * facets;
  if (bytes.size() == announced && facets > 0) {
    if (uint64_t{facets} * 3 > kMaxModelVertices) {
      return FileError(file, absl::StrCat("has ", facets, " triangles"),
                       absl::StrCat("at most ", kMaxModelVertices / 3, " are read"));
    }
    return absl::OkStatus();
  }
  const absl::string_view text = absl::StripLeadingAsciiWhitespace(bytes);
  const bool is_text = bytes.substr(0, 1024).find('\0') == absl::string_view::npos;
  if (absl::StartsWithIgnoreCase(text, "solid") && is_text) return CheckAscii(file);
  if (bytes.size() < kBinaryHeader || is_text) {
    return FileError(file,
                     absl::StrCat("is ", DescribeContents(bytes), ", ", bytes.size(), " bytes"),
                     "an STL begins with \"solid\", or is binary with a header of 84 bytes");
  }
  if (facets == 0)
    return FileError(file, "is binary STL with no triangle", "at least one is expected");
  if (bytes.size() < announced) {
    return FileError(file,
                     absl::StrCat("as binary STL it announces ", facets,
                                  facets == 1 ? " triangle (" : " triangles (", announced,
                                  " bytes) but has ", bytes.size(), " bytes"),
                     "the file is truncated, or not an STL");
  }
  // More than announced: some exporters append attributes. The facets are there, so it can be read.
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
