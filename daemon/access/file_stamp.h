// Detects whether a file has changed since it was read.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <optional>
#include <string>

namespace voxeld::daemon::access {

// File attributes that change when the file is written or replaced.
struct FileStamp {
  uint64_t device = 0, inode = 0;
  int64_t size = 0, modified_ns = 0, changed_ns = 0;
  bool operator==(const FileStamp&) const = default;
};

// Returns: nothing if the file does not exist or is not accessible.
inline std::optional<FileStamp> StampOf(const std::string& path) {
  struct stat found;
  if (stat(path.c_str(), &found) != 0) return {};
  constexpr int64_t kSecond = 1'000'000'000;
  return FileStamp{found.st_dev, found.st_ino, found.st_size,
                   found.st_mtim.tv_sec * kSecond + found.st_mtim.tv_nsec,
                   found.st_ctim.tv_sec * kSecond + found.st_ctim.tv_nsec};
}

}  // namespace voxeld::daemon::access
