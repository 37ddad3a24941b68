#include "daemon/assets/asset_file.h"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::assets {
namespace {

constexpr size_t kHashedAtOnce = 1u << 20;

absl::Status Failed(const char* what) {
  const int error = errno;
  const std::string message = absl::StrCat(what, ": ", std::generic_category().message(error));
  const bool no_room = error == ENOSPC || error == EDQUOT || error == EFBIG || error == EMFILE ||
                       error == ENFILE || error == ENOMEM;
  return no_room ? absl::ResourceExhaustedError(message) : absl::UnavailableError(message);
}

std::string FolderOf(const std::string& path) { return path.substr(0, path.rfind('/')); }

}  // namespace

absl::StatusOr<std::shared_ptr<AssetFile>> AssetFile::Open(const std::string& path,
                                                           uint64_t* size) {
  Descriptor file(path.empty() ? memfd_create("voxeld-asset", MFD_CLOEXEC)
                               : open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW,
                                      S_IRUSR | S_IWUSR));
  if (!file.ok()) return Failed("cannot be opened");
  struct stat info = {};
  if (fstat(file.get(), &info) != 0) return Failed("cannot be looked at");
  if (!S_ISREG(info.st_mode)) return absl::UnavailableError("is no plain file");
  *size = static_cast<uint64_t>(info.st_size);
  return std::shared_ptr<AssetFile>(new AssetFile(path, std::move(file)));
}

absl::Status AssetFile::Write(uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t wrote =
        pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote <= 0) return Failed("cannot be written");
    offset += static_cast<uint64_t>(wrote);
    bytes.remove_prefix(static_cast<size_t>(wrote));
  }
  return absl::OkStatus();
}

absl::Status AssetFile::Empty() {
  if (ftruncate(file_.get(), 0) != 0) return Failed("cannot be emptied");
  return absl::OkStatus();
}

absl::StatusOr<wire::MappedRange> AssetFile::Read(uint64_t offset, uint64_t size) const {
  const std::shared_ptr<char[]> bytes = std::make_shared_for_overwrite<char[]>(size);
  for (uint64_t at = 0; at < size;) {
    const ssize_t read =
        pread(file_.get(), bytes.get() + at, size - at, static_cast<off_t>(offset + at));
    if (read < 0 && errno == EINTR) continue;
    if (read < 0) return Failed("cannot be read");
    if (read == 0) return absl::UnavailableError("cannot be read: it is shorter than it was");
    at += static_cast<uint64_t>(read);
  }
  return wire::MappedRange{{bytes.get(), size}, bytes};
}

absl::StatusOr<std::string> AssetFile::Hash(uint64_t size) const {
  const std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context(EVP_MD_CTX_new(),
                                                                   EVP_MD_CTX_free);
  EVP_DigestInit_ex(context.get(), EVP_sha256(), nullptr);
  for (uint64_t at = 0; at < size; at += kHashedAtOnce) {
    const auto piece = Read(at, std::min<uint64_t>(kHashedAtOnce, size - at));
    if (!piece.ok()) return piece.status();
    EVP_DigestUpdate(context.get(), piece->bytes.data(), piece->bytes.size());
  }
  std::string digest(EVP_MD_size(EVP_sha256()), '\0');
  EVP_DigestFinal_ex(context.get(), reinterpret_cast<unsigned char*>(digest.data()), nullptr);
  return digest;
}

absl::Status AssetFile::Keep(const std::string& path) {
  if (path_.empty()) return absl::OkStatus();
  if (fdatasync(file_.get()) != 0) return Failed("cannot be written");
  if (rename(path_.c_str(), path.c_str()) != 0) return Failed("cannot be renamed");
  path_ = path;
  const Descriptor folder(open(FolderOf(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.ok() || fsync(folder.get()) != 0) return Failed("cannot be written");
  return absl::OkStatus();
}

void AssetFile::Remove() {
  if (!path_.empty()) (void)unlink(path_.c_str());
  path_.clear();
}

void AssetFile::Touch() const {
  if (!path_.empty()) (void)futimens(file_.get(), nullptr);
}

}  // namespace voxeld::daemon::assets
