// A file that is to be played, in a folder of its own that nobody else may look into; both go with the object.
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

// A folder of mode 0700 where the system has temporary files ($TMPDIR, else /tmp); removed with all that is in it. Locked by
// flock(2) while the object is there, which the system ends with the process.
class PrivateFolder {
 public:
  static absl::StatusOr<PrivateFolder> Make();
  // Removes those of this user that nobody has locked: whoever made them was killed. Of what has such a folder's name, only folders
  // of mode 0700 that are this user's, by no link, and in them no further folders. Where the file system has no such locks none
  // is. Returns how many went. Blocks as the disk does.
  static size_t RemoveLeft();
  PrivateFolder(PrivateFolder&& other) noexcept;
  PrivateFolder& operator=(PrivateFolder&& other) noexcept;
  ~PrivateFolder();
  const std::string& path() const { return path_; }

 private:
  PrivateFolder(std::string path, Descriptor lock)
      : path_(std::move(path)), lock_(std::move(lock)) {}
  void Remove();
  std::string path_;  // empty: moved from
  Descriptor lock_;   // of the folder itself
};

// What a file that somebody calls `name` is called here: its last part, with no bytes that a terminal, a shell or
// voxelctl would take for something else, at most kLongestName bytes, with its extension. Never empty.
inline constexpr size_t kLongestName = 120;
std::string SafeName(std::string_view name);

// For one thread at a time. Blocks as the disk does.
class PlayFile {
 public:
  // As write(2); tests have disks that are full.
  using Write = std::function<ssize_t(int descriptor, const char* bytes, size_t size)>;

  // A new one, empty, mode 0600. Errors: as the system has them.
  static absl::StatusOr<PlayFile> Make(std::string_view name, Write write = nullptr);

  // ResourceExhausted if there is no room.
  absl::Status Append(std::string_view bytes);
  const std::string& name() const { return name_; }
  std::string path() const { return folder_.path() + "/" + name_; }
  uint64_t bytes() const { return bytes_; }
  // What is in the path before the name, for whoever tells people of the file.
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
