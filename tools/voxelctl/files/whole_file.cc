#include "tools/voxelctl/files/whole_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

absl::Status ErrorOf(const std::string& path, const char* what) {
  const int error = errno;
  return absl::PermissionDeniedError(
      absl::StrCat(EscapeForTerminal(path), ": ", what, ": ", std::strerror(error)));
}

}  // namespace

absl::StatusOr<std::unique_ptr<WholeFile>> WholeFile::Create(const std::string& name) {
  std::error_code ignored;
  // A link stays a link: the file that it leads to is replaced.
  const std::filesystem::path target = std::filesystem::canonical(name, ignored);
  const std::string path = target.empty() ? name : target.string();
  if (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored)) {
    const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
    if (file < 0) return ErrorOf(name, "cannot be written");
    return std::unique_ptr<WholeFile>(new WholeFile(name, name, file));
  }
  for (int attempt = 0; attempt < 100; ++attempt) {
    std::string temporary = absl::StrCat(path, ".", ::getpid(), ".", attempt, ".tmp");
    const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file >= 0) {
      return std::unique_ptr<WholeFile>(new WholeFile(path, std::move(temporary), file));
    }
    if (errno != EEXIST) break;
  }
  return ErrorOf(path, "cannot be written");
}

WholeFile::~WholeFile() {
  ::close(file_);
  if (!in_place_ && temporary_ != path_) ::unlink(temporary_.c_str());
}

absl::Status WholeFile::SystemError(const char* what) const { return ErrorOf(path_, what); }

absl::Status WholeFile::Write(absl::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t wrote = ::write(file_, bytes.data(), bytes.size());
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) return SystemError("could not be written");
    bytes.remove_prefix(static_cast<size_t>(wrote));
  }
  return absl::OkStatus();
}

absl::Status WholeFile::Commit() {
  // A pipe or a terminal has nothing to put on a disk.
  if (::fsync(file_) != 0 && errno != EINVAL) return SystemError("could not be written");
  if (temporary_ != path_ && ::rename(temporary_.c_str(), path_.c_str()) != 0)
    return SystemError("could not be put in place");
  in_place_ = true;
  return absl::OkStatus();
}

absl::Status WriteWholeFile(const std::string& path, absl::string_view bytes) {
  const absl::StatusOr<std::unique_ptr<WholeFile>> file = WholeFile::Create(path);
  if (!file.ok()) return file.status();
  if (absl::Status status = (*file)->Write(bytes); !status.ok()) return status;
  return (*file)->Commit();
}

}  // namespace voxeld::voxelctl
