// Files that are written completely or not at all.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {

// A new file beside `path` that Commit() renames there: a reader sees the old file or the new one. Without Commit() nothing of it stays.
// Its permissions are those of any new file of the user. If `path` is a link, the file that it leads to is replaced. A pipe, device or
// other file that is not a regular one is written as it is. Messages of errors begin with the path, escaped for a terminal. Not
// thread-safe.
class WholeFile {
 public:
  // PermissionDenied if it cannot be created or opened.
  static absl::StatusOr<std::unique_ptr<WholeFile>> Create(const std::string& path);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  // Appends to the file.
  absl::Status Write(absl::string_view bytes);

  // Syncs the file to the disk and puts it in place; nothing can be written afterwards.
  absl::Status Commit();

  // Returns its path until then, for another program that writes it.
  const std::string& temporary() const { return temporary_; }

 private:
  WholeFile(std::string path, std::string temporary, int file)
      : path_(std::move(path)), temporary_(std::move(temporary)), file_(file) {}
  absl::Status SystemError(const char* what) const;

  const std::string path_, temporary_;
  const int file_;
  bool in_place_ = false;
};

// Writes the whole file in one call.
absl::Status WriteWholeFile(const std::string& path, absl::string_view bytes);

}  // namespace voxeld::voxelctl
