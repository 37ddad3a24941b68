// Reads a file and the files that it names, and describes contents in messages.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

inline constexpr uint64_t kMaxFileBytes = uint64_t{2} << 30;

// The files that may be read because a file names them, or because a library looks for them beside
// it. A file may be untrusted, and must not cause other files of this user to be drawn.
enum class OtherFiles : uint8_t {
  kNone,
  kBelow,  // regular files in the file's own folder and below, but no links that lead out
  kAny,    // every regular file
};

struct SourceFile {
  std::string path;
  std::string extension;  // in lower case, without the dot
  std::string bytes;
  OtherFiles other_files = OtherFiles::kBelow;
};

// Returns the extension in lower case, without the dot; empty without one.
std::string ExtensionOf(const std::string& path);

// Reads a file. Errors: NotFound, PermissionDenied or InvalidArgument (a directory, an empty file,
// more than kMaxFileBytes); the message begins with the path.
absl::StatusOr<SourceFile> ReadSourceFile(const std::string& path,
                                          OtherFiles other_files = OtherFiles::kBelow);

// Reads the file that `file` calls `name`; a relative name is relative to the folder of `file`.
// Opens neither FIFOs nor devices. Errors: FailedPrecondition if file.other_files forbids it, or if
// it is missing, not a regular file, empty or larger than kMaxFileBytes. The message is a clause
// for FileError. It is the same in all these cases, so that it does not reveal which files exist.
absl::StatusOr<SourceFile> ReadOtherFile(const SourceFile& file, const std::string& name);

// Describes what the bytes look like: "a PNG picture", "JSON text", "text that begins with
// \"hello\"", "binary data".
std::string DescribeContents(absl::string_view bytes);

// Removes the first line of `text`, which is not empty, with its end: LF, CR LF, or CR alone.
// Returns: the line without its end.
absl::string_view TakeLine(absl::string_view* text);

// Returns a clause for binary contents that are too short, if every CR LF was turned into LF on the
// way, as a transfer in text mode does; otherwise empty.
std::string TextModeHint(absl::string_view bytes);

// Returns InvalidArgument "PATH: FOUND; EXPECTED".
absl::Status FileError(const SourceFile& file, absl::string_view found, absl::string_view expected);

}  // namespace voxeld::voxelctl
