// A file to play, in a private folder. Both are removed with the object.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"

namespace voxeld::daemon::play {

// A folder of mode 0700 in the system's folder for temporary files ($TMPDIR, else /tmp). It is
// removed with its contents when the object is destroyed. While the object exists, the folder is
// locked by flock(2); the system releases the lock when the process ends.
class PrivateFolder {
 public:
  static absl::StatusOr<PrivateFolder> Make();
  // Removes this user's unlocked folders, whose processes have been killed. Removes only folders
  // with such a name that have mode 0700, belong to this user, are not links and contain no further
  // folders. Removes nothing if the file system has no such locks. Returns: the number of removed
  // folders. Blocks on the disk.
  static size_t RemoveLeft();
  PrivateFolder(PrivateFolder&& other) noexcept;
  PrivateFolder& operator=(PrivateFolder&& other) noexcept;
  ~PrivateFolder();
  const std::string& path() const { return path_; }

 private:
  PrivateFolder(std::string path, Descriptor lock)
      : path_(std::move(path)), lock_(std::move(lock)) {}
  void Remove();
  std::string path_;  // empty after a move
  Descriptor lock_;   // of the folder itself
};

// The local name of a file that a client calls `name`: the last component, without bytes that are
// special to a terminal, a shell or voxelctl, with its extension, and at most kLongestName bytes.
// Never empty.
inline constexpr size_t kLongestName = 120;
std::string SafeName(std::string_view name);

// Not thread-safe. Blocks on the disk.
class PlayFile {
 public:
  // Has the signature of write(2). Tests replace it to simulate a full disk.
  using Write = std::function<ssize_t(int descriptor, const char* bytes, size_t size)>;

  // Creates an empty file with mode 0600. Errors: those of the system.
  static absl::StatusOr<PlayFile> Make(std::string_view name, Write write = nullptr);

  // Errors: ResourceExhausted if the disk is full.
  absl::Status Append(std::string_view bytes);
  const std::string& name() const { return name_; }
  std::string path() const { return folder_.path() + "/" + name_; }
  uint64_t bytes() const { return bytes_; }
  // Returns: the part of the path before the name, which messages for people should not show.
  std::string prefix() const { return folder_.path() + "/"; }

 private:
  PlayFile(PrivateFolder folder, std::string name, Write write)
      : folder_(std::move(folder)), name_(std::move(name)), write_(std::move(write)) {}

  PrivateFolder folder_;
  std::string name_;
  Write write_;
  Descriptor descriptor_;
  uint64_t bytes_ = 0;
};

}  // namespace voxeld::daemon::play
