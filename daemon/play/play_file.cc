#include "daemon/play/play_file.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::play {

namespace {

constexpr char kFolderName[] = "voxeld-play-";
constexpr mode_t kOwnersAlone = 0700;
constexpr int kTries = 100;

Descriptor OpenFolder(int at, const char* path) {
  return Descriptor(openat(at, path, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
}

// Locks the folder. Returns: 0 or an errno. ENOENT and EWOULDBLOCK mean that RemoveLeft of another
// daemon is removing it as abandoned. On file systems without locks, RemoveLeft removes nothing and
// this locks nothing.
int Lock(const std::string& path, Descriptor& folder) {
  folder = OpenFolder(AT_FDCWD, path.c_str());
  if (!folder.ok()) return errno;
  if (flock(folder.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) return EWOULDBLOCK;
  struct stat open = {}, named = {};
  if (fstat(folder.get(), &open) != 0 || lstat(path.c_str(), &named) != 0) return errno;
  return open.st_dev == named.st_dev && open.st_ino == named.st_ino ? 0 : ENOENT;
}

// Removes the folder and the files in it. A folder that contains folders stays. Returns: whether it
// was removed.
bool RemoveFolder(int at, const char* name, const Descriptor& folder) {
  const int listed = fcntl(folder.get(), F_DUPFD_CLOEXEC, 0);
  DIR* const entries = listed < 0 ? nullptr : fdopendir(listed);
  if (entries == nullptr) {
    if (listed >= 0) close(listed);
    return false;
  }
  while (const dirent* entry = readdir(entries)) unlinkat(folder.get(), entry->d_name, 0);
  closedir(entries);
  return unlinkat(at, name, AT_REMOVEDIR) == 0;
}

}  // namespace

absl::StatusOr<PrivateFolder> PrivateFolder::Make() {
  std::error_code error;
  const std::string pattern =
      (std::filesystem::temp_directory_path(error) / absl::StrCat(kFolderName, "XXXXXX")).string();
  const auto failed = [](int code, const std::string& path) {
    return absl::ErrnoToStatus(
        code, absl::StrCat("no folder for files to be played can be made (", path, ")"));
  };
  if (error) return failed(error.value(), pattern);
  for (int tries = 1;; ++tries) {
    std::string path = pattern;
    if (mkdtemp(path.data()) == nullptr) return failed(errno, path);
    Descriptor folder;
    const int why = Lock(path, folder);
    if (why == 0) return PrivateFolder(std::move(path), std::move(folder));
    rmdir(path.c_str());
    if (tries == kTries || (why != ENOENT && why != EWOULDBLOCK)) return failed(why, path);
  }
}

size_t PrivateFolder::RemoveLeft() {
  std::error_code error;
  const std::filesystem::path where = std::filesystem::temp_directory_path(error);
  const Descriptor all =
      error ? Descriptor() : Descriptor(open(where.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  const int listed = all.ok() ? fcntl(all.get(), F_DUPFD_CLOEXEC, 0) : -1;
  DIR* const entries = listed < 0 ? nullptr : fdopendir(listed);
  if (entries == nullptr) {
    if (listed >= 0) close(listed);
    return 0;
  }
  size_t removed = 0;
  while (const dirent* entry = readdir(entries)) {
    if (!std::string_view(entry->d_name).starts_with(kFolderName)) continue;
    const Descriptor folder = OpenFolder(all.get(), entry->d_name);
    struct stat found = {};
    if (!folder.ok() || fstat(folder.get(), &found) != 0 || found.st_uid != geteuid() ||
        (found.st_mode & 0777) != kOwnersAlone || flock(folder.get(), LOCK_EX | LOCK_NB) != 0) {
      continue;
    }
    if (RemoveFolder(all.get(), entry->d_name, folder)) ++removed;
  }
  closedir(entries);
  return removed;
}

PrivateFolder::PrivateFolder(PrivateFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})), lock_(std::move(other.lock_)) {}

PrivateFolder& PrivateFolder::operator=(PrivateFolder&& other) noexcept {
  if (this == &other) return *this;
  Remove();
  path_ = std::exchange(other.path_, {});
  lock_ = std::move(other.lock_);
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
    // voxelctl interprets '#' and '%' as placeholders for numbers.
    const bool odd = static_cast<unsigned char>(c) < 0x20 || c == 0x7f ||
                     std::string_view("#%*?\"'`<>|:;&$!").find(c) != std::string_view::npos;
    safe += odd ? '_' : c;
  }
  if (safe.size() > kLongestName) {
    const size_t dot = safe.rfind('.');
    std::string extension = dot == std::string::npos ? "" : safe.substr(dot);
    if (extension.size() > kLongestName / 2) extension.clear();
    size_t end = kLongestName - extension.size();
    while (end > 0 && (safe[end] & 0xc0) == 0x80) --end;  // do not split a code point
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
