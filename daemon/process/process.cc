#include "daemon/process/process.h"

#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <new>
#include <system_error>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/synchronization/mutex.h"

namespace voxeld::daemon {
namespace {

// Free memory that each arena of the allocator keeps. Messages are read in slices of several
// kilobytes that are freed together; without this, every message of 1 MiB would cause hundreds of
// page faults.
constexpr int kKeptBytes = 16 << 20;
constexpr int kGrownBytes = 1 << 20;
constexpr int kMappedBytes = 4 << 20;  // larger blocks are mapped, and returned at once
// By default glibc creates eight arenas per core, and each keeps the peak memory of its threads.
constexpr unsigned kLeastArenas = 4;

}  // namespace

void TuneProcess() {
  absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore);
#ifdef __GLIBC__
  mallopt(M_TRIM_THRESHOLD, kKeptBytes);
  mallopt(M_TOP_PAD, kGrownBytes);
  mallopt(M_MMAP_THRESHOLD, kMappedBytes);
  mallopt(M_ARENA_MAX,
          static_cast<int>(std::max(kLeastArenas, std::thread::hardware_concurrency())));
#endif
}

void GiveBackFreeMemory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

uint64_t HeapBytes() {
#ifdef __GLIBC__
  const struct mallinfo2 heap = mallinfo2();
  return uint64_t{heap.uordblks} + heap.hblkhd;
#else
  return 0;
#endif
}

void RaiseDescriptorLimit() {
  rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

std::string WhyItEnds(const std::exception& error) {
  const auto* const refused = dynamic_cast<const std::system_error*>(&error);
  if (refused != nullptr && refused->code() == std::errc::resource_unavailable_try_again) {
    return absl::StrCat("the system gives it no more threads (", error.what(),
                        "): allow it more of them (TasksMax, LimitNPROC, ulimit -u), or more "
                        "memory for their stacks (LimitAS, ulimit -v)");
  }
  if (refused != nullptr && refused->code() == std::errc::too_many_files_open) {
    return absl::StrCat("the system gives it no more descriptors (", error.what(),
                        "): allow it more of them (LimitNOFILE, ulimit -n)");
  }
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
    return absl::StrCat("there is no memory (", error.what(),
                        "): allow it more (MemoryMax, LimitAS, ulimit -v)");
  }
  return error.what();
}

}  // namespace voxeld::daemon
