#include "daemon/process/process.h"

#include <malloc.h>
#include <sys/resource.h>

#include "absl/synchronization/mutex.h"

namespace voxeld::daemon {
namespace {

// Of each of the allocator's arenas. Messages are read in slices of some kilobytes and freed together; without
// these every message of a mebibyte costs hundreds of page faults.
constexpr int kKeptBytes = 16 << 20;
constexpr int kGrownBytes = 1 << 20;
constexpr int kMappedBytes = 4 << 20;  // from here on memory is mapped, and goes back at once

}  // namespace

void TuneProcess() {
  absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore);
#ifdef __GLIBC__
  mallopt(M_TRIM_THRESHOLD, kKeptBytes);
  mallopt(M_TOP_PAD, kGrownBytes);
  mallopt(M_MMAP_THRESHOLD, kMappedBytes);
#endif
}

void RaiseDescriptorLimit() {
  rlimit limit;
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace voxeld::daemon
