#include "daemon/assets/asset_file.h"

#include <fcntl.h>
#include <openssl/evp.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <new>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::assets {
namespace {

constexpr size_t kHashedAtOnce = 1u << 20;

absl::Status Failed(const char* what) {
  const int error = errno;
  const std::string message = absl::StrCat(what, ": ", std::generic_category().message(error));
  const bool no_room = error == ENOSPC || error == EDQUOT || error == EFBIG || error == EMFILE ||
                       error == ENFILE || error == ENOMEM;
  if (error == ENOENT) return absl::OutOfRangeError(message);
  return no_room ? absl::ResourceExhaustedError(message) : absl::UnavailableError(message);
}

// Throws std::bad_alloc on failure, because an incomplete hash would report intact content as
// damaged.
class Hash {
 public:
  Hash() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    if (context_ == nullptr) throw std::bad_alloc();
    Check(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr));
  }
  void Add(std::string_view bytes) {
    Check(EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()));
  }
  std::string Finish() {
    std::string digest(static_cast<size_t>(EVP_MD_size(EVP_sha256())), '\0');
    Check(EVP_DigestFinal_ex(context_.get(), reinterpret_cast<unsigned char*>(digest.data()),
                             nullptr));
    return digest;
  }

 private:
  // OpenSSL's digest functions fail only if memory runs out.
  static void Check(int done) {
    if (done != 1) throw std::bad_alloc();
  }

  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context_;
};

absl::Status ReadAll(const Descriptor& file, uint64_t offset, uint64_t size, char* out) {
  for (uint64_t at = 0; at < size;) {
    const ssize_t read = pread(file.get(), out + at, size - at, static_cast<off_t>(offset + at));
    if (read < 0 && errno == EINTR) continue;
    if (read < 0) return Failed("cannot be read");
    if (read == 0) return absl::OutOfRangeError("is shorter than it was");
    at += static_cast<uint64_t>(read);
  }
  return absl::OkStatus();
}

Descriptor OpenToRead(const std::string& path) {
  return Descriptor(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
}

}  // namespace

absl::StatusOr<AssetFile> AssetFile::Open(const std::string& path, bool empty) {
  Descriptor file(open(path.c_str(),
                       O_WRONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | (empty ? O_TRUNC : 0),
                       S_IRUSR | S_IWUSR));
  if (!file.ok()) return Failed("cannot be opened");
  return AssetFile(path, std::move(file));
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

absl::Status AssetFile::Keep(const std::string& path) {
  if (fdatasync(file_.get()) != 0) return Failed("cannot be written");
  const Descriptor folder(
      open(path.substr(0, path.rfind('/')).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.ok()) return Failed("cannot be written");
  if (rename(path_.c_str(), path.c_str()) != 0) return Failed("cannot be renamed");
  if (fsync(folder.get()) != 0) {
    const absl::Status status = Failed("cannot be written");
    (void)rename(path.c_str(), path_.c_str());
    return status;
  }
  path_ = path;
  return absl::OkStatus();
}

absl::StatusOr<wire::MappedRange> ReadAssetFile(const std::string& path, uint64_t offset,
                                                uint64_t size) {
  const Descriptor file = OpenToRead(path);
  if (!file.ok()) return Failed("cannot be opened");
  const std::shared_ptr<char[]> bytes = std::make_shared_for_overwrite<char[]>(size);
  if (absl::Status status = ReadAll(file, offset, size, bytes.get()); !status.ok()) return status;
  return wire::MappedRange{{bytes.get(), size}, bytes};
}

absl::StatusOr<std::string> HashAssetFile(const std::string& path, uint64_t size) {
  const Descriptor file = OpenToRead(path);
  if (!file.ok()) return Failed("cannot be opened");
  Hash hash;
  std::string piece(std::min<uint64_t>(size, kHashedAtOnce), '\0');
  for (uint64_t at = 0; at < size; at += piece.size()) {
    const uint64_t take = std::min<uint64_t>(piece.size(), size - at);
    if (absl::Status status = ReadAll(file, at, take, piece.data()); !status.ok()) return status;
    hash.Add(std::string_view(piece).substr(0, take));
  }
  return hash.Finish();
}

std::string HashBytes(std::string_view bytes) {
  Hash hash;
  hash.Add(bytes);
  return hash.Finish();
}

void TouchAssetFile(const std::string& path) {
  (void)utimensat(AT_FDCWD, path.c_str(), nullptr, 0);
}

}  // namespace voxeld::daemon::assets
