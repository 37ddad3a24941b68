#include "tools/voxelctl/import/json_text.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/json/json_depth.h"

namespace voxeld::voxelctl {

absl::StatusOr<nlohmann::json> ParseJson(const SourceFile& file, absl::string_view text) {
  if (absl::StartsWith(text, "\xef\xbb\xbf")) text.remove_prefix(3);
  const absl::string_view body = absl::StripLeadingAsciiWhitespace(text);
  if (body.empty() || (body.front() != '{' && body.front() != '[')) {
    return FileError(file, absl::StrCat("is ", DescribeContents(text)),
                     "JSON in UTF-8 is expected");
  }
  if (const int depth = JsonDepth({text.data(), text.size()}); depth > kMaxJsonDepth) {
    return FileError(file, absl::StrCat("nests ", depth, " deep"),
                     absl::StrCat("at most ", kMaxJsonDepth, " are read"));
  }
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& error) {
    if (error.byte > text.size()) {
      return FileError(file,
                       absl::StrCat("the JSON ends after ", text.size(), " bytes, unfinished"),
                       "the file is probably truncated");
    }
    if (error.byte > 0 && nlohmann::json::accept(text.substr(0, error.byte - 1))) {
      return FileError(file, absl::StrCat("has a second JSON document at byte ", error.byte),
                       "one document is expected; ogr2ogr converts files with one feature on each "
                       "line to a FeatureCollection");
    }
    return FileError(file, absl::StrCat("the JSON is malformed at byte ", error.byte),
                     "well-formed JSON is expected");
  } catch (const nlohmann::json::exception& error) {
    return FileError(file, absl::StrCat("the JSON holds a number out of range"),
                     "numbers must fit a double");
  }
}

}  // namespace voxeld::voxelctl
