#include "gpu/worker/segment.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL;

absl::Status Failed(const char* what, size_t size) {
  return absl::ResourceExhaustedError(absl::StrCat("shared memory of ", size, " bytes: ", what,
                                                   ": ", std::generic_category().message(errno)));
}

}  // namespace

absl::StatusOr<std::shared_ptr<Segment>> Segment::Map(int fd, size_t size) {
  void* data = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (data == MAP_FAILED) {
    const absl::Status status = Failed("mmap", size);
    close(fd);
    return status;
  }
  return std::shared_ptr<Segment>(new Segment(fd, static_cast<std::byte*>(data), size));
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::Create(size_t size) {
  const int fd = memfd_create("voxeld-engine", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (fd < 0) return Failed("memfd_create", size);
  if (ftruncate(fd, static_cast<off_t>(size)) != 0 || fcntl(fd, F_ADD_SEALS, kSeals) != 0) {
    const absl::Status status = Failed("ftruncate", size);
    close(fd);
    return status;
  }
  return Map(fd, size);
}

absl::StatusOr<std::shared_ptr<Segment>> Segment::Adopt(int fd, size_t size) {
  struct stat found;
  const int seals = fcntl(fd, F_GET_SEALS);
  if (seals < 0 || (seals & kSeals) != kSeals || fstat(fd, &found) != 0 ||
      static_cast<size_t>(found.st_size) != size || size == 0) {
    close(fd);
    return absl::InvalidArgumentError(
        absl::StrCat("a segment of ", size, " bytes is not of that size, or not sealed"));
  }
  return Map(fd, size);
}

Segment::~Segment() {
  munmap(data_, size_);
  close(fd_);
}

}  // namespace voxeld::gpu
