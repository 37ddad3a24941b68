#include "daemon/local/local_memory.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::daemon::local {
namespace {

struct Seal {
  int flag;
  const char* name;
};
constexpr Seal kSeals[] = {
    {F_SEAL_SHRINK, "F_SEAL_SHRINK"}, {F_SEAL_GROW, "F_SEAL_GROW"}, {F_SEAL_WRITE, "F_SEAL_WRITE"}};
constexpr const char* kSealNames = "F_SEAL_SHRINK, F_SEAL_GROW and F_SEAL_WRITE";

std::string ErrorText() { return std::generic_category().message(errno); }

// Checks the seals first. Only memfds have them, and operations on a file of another file system
// may block.
absl::Status CheckSeals(uint64_t id, int fd) {
  const int seals = fcntl(fd, F_GET_SEALS);
  if (seals < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("the descriptor of memory ", id, " is no memfd (", ErrorText(),
                     "); make it with memfd_create and MFD_ALLOW_SEALING, and add ", kSealNames));
  }
  std::vector<const char*> missing;
  for (const Seal& seal : kSeals) {
    if ((seals & seal.flag) == 0) missing.push_back(seal.name);
  }
  if (missing.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("memory ", id, " is not sealed with ",
                                                 absl::StrJoin(missing, ", "), "; fill it, add ",
                                                 kSealNames, ", then send it"));
}

absl::Status CheckSize(uint64_t id, uint64_t size, int fd) {
  struct stat found;
  if (fstat(fd, &found) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("the size of memory ", id, " is not known: ", ErrorText()));
  }
  if (size == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("memory ", id, " is said to have 0 bytes; give the memfd's own size, ",
                     found.st_size, found.st_size == 0 ? ", which must be at least 1" : ""));
  }
  if (static_cast<uint64_t>(found.st_size) != size) {
    return absl::InvalidArgumentError(absl::StrCat("memory ", id, " is said to have ", size,
                                                   " bytes and has ", found.st_size,
                                                   "; give the memfd's own size"));
  }
  return absl::OkStatus();
}

}  // namespace

// Counted and charged to the budget while it exists.
class LocalMemory::Mapping {
 public:
  // `budget` may be null.
  static absl::StatusOr<std::shared_ptr<const Mapping>> Make(
      uint64_t size, int fd, std::shared_ptr<std::atomic<uint32_t>> mapped,
      std::shared_ptr<Budget> budget) {
    if (budget != nullptr && !budget->Charge(Budget::Use::kLocal, size)) {
      return absl::ResourceExhaustedError(
          absl::StrCat("would be held beside ", budget->used_bytes(),
                       " of all clients; max_memory_bytes allows ", budget->limit_bytes(),
                       ": release some, or try again when others have"));
    }
    void* data = mmap(nullptr, size, PROT_READ, MAP_SHARED, fd, 0);
    if (data == MAP_FAILED) {
      const std::string why = ErrorText();
      if (budget != nullptr) budget->Release(Budget::Use::kLocal, size);
      return absl::ResourceExhaustedError(absl::StrCat("cannot be mapped: ", why));
    }
    return std::shared_ptr<const Mapping>(
        new Mapping(data, size, std::move(mapped), std::move(budget)));
  }

  ~Mapping() {
    munmap(data_, size_);
    mapped_->fetch_sub(1);
    if (budget_ != nullptr) budget_->Release(Budget::Use::kLocal, size_);
  }
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;

  uint64_t size() const { return size_; }

  std::string_view Range(uint64_t offset, uint64_t size) const {
    return {static_cast<const char*>(data_) + offset, size};
  }

  // Populates the pages of a range. A page that was never written has no memory yet, and reading it
  // would terminate the process if the system had none left.
  bool Populate(uint64_t offset, uint64_t size) const {
    if (size == 0) return true;
    const uint64_t page = static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
    const uint64_t first = offset - offset % page;
    const uint64_t bytes = offset + size - first;
    char* at = static_cast<char*>(data_) + first;
    while (madvise(at, bytes, MADV_POPULATE_READ) != 0) {
      if (errno == EAGAIN || errno == EINTR) continue;
      return errno == EINVAL;  // a kernel before 5.14, or an unsupported kind of page
    }
    return true;
  }

 private:
  Mapping(void* data, uint64_t size, std::shared_ptr<std::atomic<uint32_t>> mapped,
          std::shared_ptr<Budget> budget)
      : data_(data), size_(size), mapped_(std::move(mapped)), budget_(std::move(budget)) {
    mapped_->fetch_add(1);
  }

  void* const data_;
  const uint64_t size_;
  const std::shared_ptr<std::atomic<uint32_t>> mapped_;
  const std::shared_ptr<Budget> budget_;
};

absl::Status LocalMemory::Hold(uint64_t id, uint64_t size, int fd) {
  if (absl::Status status = CheckSeals(id, fd); !status.ok()) return status;
  if (absl::Status status = CheckSize(id, size, fd); !status.ok()) return status;
  sync::MutexLock lock(mutex_);
  if (ended_) return absl::FailedPreconditionError("the session has ended");
  if (held_.contains(id)) {
    return absl::AlreadyExistsError(
        absl::StrCat("memory ", id, " is held already; release it, or give another id"));
  }
  if (held_.size() >= limits_.max_memories) {
    return absl::ResourceExhaustedError(absl::StrCat("memory ", id, " would be one more than ",
                                                     held_.size(), "; max_local_memories allows ",
                                                     limits_.max_memories, ": release some"));
  }
  if (size > limits_.max_bytes - bytes_) {
    return absl::ResourceExhaustedError(absl::StrCat("memory ", id, " has ", size, " bytes, and ",
                                                     bytes_, " are held; max_local_bytes allows ",
                                                     limits_.max_bytes, ": release some"));
  }
  if (mapped_->load() >= limits_.max_memories_total) {
    return absl::ResourceExhaustedError(
        absl::StrCat("memory ", id, ": all sessions together hold ", mapped_->load(), " memories; ",
                     limits_.max_memories_total, " are possible: use fewer that are larger"));
  }
  absl::StatusOr<std::shared_ptr<const Mapping>> mapping =
      Mapping::Make(size, fd, mapped_, budget_);
  if (!mapping.ok()) {
    return absl::ResourceExhaustedError(
        absl::StrCat("memory ", id, " of ", size, " bytes ", mapping.status().message()));
  }
  held_.emplace(id, *std::move(mapping));
  bytes_ += size;
  return absl::OkStatus();
}

absl::Status LocalMemory::Release(uint64_t id) {
  std::shared_ptr<const Mapping> released;  // unmapped without the lock
  sync::MutexLock lock(mutex_);
  const auto found = held_.find(id);
  if (found == held_.end()) {
    return absl::NotFoundError(absl::StrCat("memory ", id, " is not held; ", held_.size(),
                                            " others are, in this session"));
  }
  released = std::move(found->second);
  held_.erase(found);
  bytes_ -= released->size();
  return absl::OkStatus();
}

void LocalMemory::ReleaseAll() {
  Mappings released;
  sync::MutexLock lock(mutex_);
  released.swap(held_);
  bytes_ = 0;
}

void LocalMemory::End() {
  {
    sync::MutexLock lock(mutex_);
    ended_ = true;
  }
  ReleaseAll();
}

bool LocalMemory::ended() const {
  sync::MutexLock lock(mutex_);
  return ended_;
}

absl::StatusOr<wire::MappedRange> LocalMemory::Find(uint64_t memory, uint64_t offset,
                                                    uint64_t size) const {
  std::shared_ptr<const Mapping> mapping;
  {
    sync::MutexLock lock(mutex_);
    const auto found = held_.find(memory);
    if (found == held_.end()) {
      return absl::NotFoundError(
          absl::StrCat("is ", memory,
                       ", which this session's local socket does not hold; send it "
                       "there and wait for Held, before the request that names it"));
    }
    mapping = found->second;
  }
  if (offset > mapping->size() || size > mapping->size() - offset) {
    return absl::OutOfRangeError(absl::StrCat("is ", size, " from offset ", offset, "; memory ",
                                              memory, " has ", mapping->size(), " bytes"));
  }
  if (!mapping->Populate(offset, size)) {
    return absl::UnavailableError(absl::StrCat("is ", memory, ", of which ", size,
                                               " bytes from offset ", offset,
                                               " cannot be read: ", ErrorText()));
  }
  return wire::MappedRange{mapping->Range(offset, size), std::move(mapping)};
}

uint64_t LocalMemory::bytes() const {
  sync::MutexLock lock(mutex_);
  return bytes_;
}

uint64_t LocalMemory::memories() const {
  sync::MutexLock lock(mutex_);
  return held_.size();
}

}  // namespace voxeld::daemon::local
