// A file read whole, and the words to say what is in it.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

inline constexpr uint64_t kMaxFileBytes = uint64_t{2} << 30;

struct SourceFile {
  std::string path;
  std::string extension;  // in lower case, without the dot
  std::string bytes;
};

// NotFound, PermissionDenied or InvalidArgument (a directory, an empty file, more than
// kMaxFileBytes); the message begins with the path.
absl::StatusOr<SourceFile> ReadSourceFile(const std::string& path);

// What the bytes look like: "a PNG picture", "JSON text",
// "text that begins with \"hello\"", "binary data".
std::string DescribeContents(absl::string_view bytes);

// For binary contents that are too short: a clause that says so if every CR LF was turned into LF
// on the way, which is what a transfer as text does to a file; otherwise empty.
std::string TextModeHint(absl::string_view bytes);

// InvalidArgument "PATH: FOUND; EXPECTED".
absl::Status FileError(const SourceFile& file, absl::string_view found, absl::string_view expected);

}  // namespace voxeld::voxelctl
