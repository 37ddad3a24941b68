#include "gpu/bulk/segment.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;
#if defined(F_SEAL_FUTURE_WRITE)
constexpr int kFutureWrite = F_SEAL_FUTURE_WRITE;
#else
constexpr int kFutureWrite = 0x0010;  // linux/fcntl.h
#endif

std::atomic<uint64_t> refused = 0;

absl::Status Failed(const char* what, size_t size) {
  if (errno == ENOMEM || errno == ENOSPC) ++refused;
  return absl::ResourceExhaustedError(absl::StrCat("shared memory of ", size, " bytes: ", what,
                                                   ": ", std::generic_category().message(errno)));
}

// Creates a memfd of `size` bytes, not yet sealed. Returns −1, with errno set, on failure.
int MakeMemory(size_t size) {
  const int fd = memfd_create("voxeld-engine", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (fd < 0 || ftruncate(fd, static_cast<off_t>(size)) == 0) return fd;
  const int error = errno;
  close(fd);
  errno = error;
  return -1;
}

}  // namespace

uint64_t Segment::Refused() { return refused; }

absl::StatusOr<std::shared_ptr<Segment>> Segment::Map(int fd, size_t size, int protection) {
  const int flags = fd < 0 ? MAP_PRIVATE | MAP_ANONYMOUS : MAP_SHARED;
  void* data = mmap(nullptr, size, protection, flags, fd, 0);
  if (data == MAP_FAILED) {
    const absl::Status status = Failed("mmap", size);
    if (fd >= 0) close(fd);
    return status;
  }
  return std::shared_ptr<Segment>(new Segment(fd, static_cast<std::byte*>(data), size));
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::Create(size_t size) {
  const int fd = MakeMemory(size);
  if (fd < 0) return Failed("memfd_create", size);
  if (fcntl(fd, F_ADD_SEALS, kSeals) != 0) {
    const absl::Status status = Failed("F_ADD_SEALS", size);
    close(fd);
    return status;
  }
  return Map(fd, size, PROT_READ | PROT_WRITE);
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::CreateReadOnlyForOthers(size_t size) {
  const int fd = MakeMemory(size);
  if (fd < 0) return Failed("memfd_create", size);
  absl::StatusOr<std::shared_ptr<Segment>> segment = Map(fd, size, PROT_READ | PROT_WRITE);
  if (!segment.ok()) return segment;
  // Memory that is already mapped for writing stays writable.
  if (fcntl(fd, F_ADD_SEALS, kSeals | kFutureWrite) != 0 &&
      (errno != EINVAL || fcntl(fd, F_ADD_SEALS, kSeals) != 0)) {
    return Failed("F_ADD_SEALS", size);
  }
  return segment;
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::CreatePrivate(size_t size) {
  return Map(-1, size, PROT_READ | PROT_WRITE);
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::AdoptAs(int fd, size_t size, int protection) {
  struct stat found;
  const int seals = fcntl(fd, F_GET_SEALS);
  if (seals < 0 || (seals & kSeals) != kSeals || fstat(fd, &found) != 0 ||
      static_cast<size_t>(found.st_size) != size || size == 0) {
    close(fd);
    return absl::InvalidArgumentError(
        absl::StrCat("a segment of ", size, " bytes is not of that size, or not sealed"));
  }
  return Map(fd, size, protection);
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::Adopt(int fd, size_t size) {
  return AdoptAs(fd, size, PROT_READ | PROT_WRITE);
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::AdoptReadOnly(int fd, size_t size) {
  return AdoptAs(fd, size, PROT_READ);
}

Segment::~Segment() {
  munmap(data_, size_);
  if (fd_ >= 0) close(fd_);
}

}  // namespace voxeld::gpu
