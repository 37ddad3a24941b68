#include "daemon/play/play_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::play {

absl::StatusOr<PrivateFolder> PrivateFolder::Make() {
  std::error_code error;
  std::string path = (std::filesystem::temp_directory_path(error) / "voxeld-play-XXXXXX").string();
  if (error || mkdtemp(path.data()) == nullptr) {
    return absl::ErrnoToStatus(
        error ? error.value() : errno,
        absl::StrCat("no folder for files to be played can be made (", path, ")"));
  }
  return PrivateFolder(std::move(path));
}

PrivateFolder::PrivateFolder(PrivateFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})) {}

PrivateFolder& PrivateFolder::operator=(PrivateFolder&& other) noexcept {
  if (this == &other) return *this;
  Remove();
  path_ = std::exchange(other.path_, {});
  return *this;
}

PrivateFolder::~PrivateFolder() { Remove(); }

void PrivateFolder::Remove() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

std::string SafeName(std::string_view name) {
  name = name.substr(name.find_last_of("/\\") + 1);
  std::string safe;
  for (const char c : name) {
    // '#' and '%' are places for numbers to voxelctl.
    const bool odd = static_cast<unsigned char>(c) < 0x20 || c == 0x7f ||
                     std::string_view("#%*?\"'`<>|:;&$!").find(c) != std::string_view::npos;
    safe += odd ? '_' : c;
  }
  if (safe.size() > kLongestName) {
    const size_t dot = safe.rfind('.');
    std::string extension = dot == std::string::npos ? "" : safe.substr(dot);
    if (extension.size() > kLongestName / 2) extension.clear();
    size_t end = kLongestName - extension.size();
    while (end > 0 && (safe[end] & 0xc0) == 0x80) --end;  // no code point is cut
    safe = safe.substr(0, end) + extension;
  }
  return safe.find_first_not_of('.') == std::string::npos ? "file" : safe;
}

absl::StatusOr<PlayFile> PlayFile::Make(std::string_view name, Write write) {
  absl::StatusOr<PrivateFolder> folder = PrivateFolder::Make();
  if (!folder.ok()) return folder.status();
  if (!write)
    write = [](int fd, const char* bytes, size_t size) { return ::write(fd, bytes, size); };
  PlayFile file(*std::move(folder), SafeName(name), std::move(write));
  file.descriptor_ = Descriptor(
      open(file.path().c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
  if (!file.descriptor_.ok()) {
    return absl::ErrnoToStatus(errno, absl::StrCat(file.path(), " cannot be written"));
  }
  return file;
}

absl::Status PlayFile::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write_(descriptor_.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const int error = errno;
      const std::string what =
          absl::StrCat("the file cannot be kept in ", folder_.path(), " while it plays");
      const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
      const std::string why = std::generic_category().message(error);
      if (!full) return absl::ErrnoToStatus(error, what);
      return absl::ResourceExhaustedError(
          absl::StrCat(what, ": ", why, " after ", bytes_, " bytes; make room there"));
    }
    bytes_ += static_cast<uint64_t>(written);
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::daemon::play
