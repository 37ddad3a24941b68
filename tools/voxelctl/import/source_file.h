// A file read whole, the files that it names, and the words to say what is in it.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

inline constexpr uint64_t kMaxFileBytes = uint64_t{2} << 30;

// Which of the files that a file names, or that a library looks for beside it, may be read: whoever wrote the file may be a
// stranger, who must not have files of this user drawn.
enum class OtherFiles : uint8_t {
  kNone,
  kBelow,  // regular files in the file's own folder and below it, by no link that leads out
  kAny,    // every regular file
};

struct SourceFile {
  std::string path;
  std::string extension;  // in lower case, without the dot
  std::string bytes;
  OtherFiles other_files = OtherFiles::kBelow;
};

// NotFound, PermissionDenied or InvalidArgument (a directory, an empty file, more than
// kMaxFileBytes); the message begins with the path.
absl::StatusOr<SourceFile> ReadSourceFile(const std::string& path,
                                          OtherFiles other_files = OtherFiles::kBelow);

// Reads the file that `file` refers to as `name`, from its own folder on. Never blocks on a FIFO and opens no device.
// Errors: FailedPrecondition if file.other_files does not allow it, or if it is missing, is no regular file, is empty or has more than
// kMaxFileBytes. The message is a clause for FileError: it says what may be read, and not which of these was the case, so that
// nobody learns from it which files there are.
absl::StatusOr<SourceFile> ReadOtherFile(const SourceFile& file, const std::string& name);

// What the bytes look like: "a PNG picture", "JSON text",
// "text that begins with \"hello\"", "binary data".
std::string DescribeContents(absl::string_view bytes);

// For binary contents that are too short: a clause that says so if every CR LF was turned into LF
// on the way, which is what a transfer as text does to a file; otherwise empty.
std::string TextModeHint(absl::string_view bytes);

// InvalidArgument "PATH: FOUND; EXPECTED".
absl::Status FileError(const SourceFile& file, absl::string_view found, absl::string_view expected);

}  // namespace voxeld::voxelctl
