#include "tests/daemon/assets/disk_calls.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <optional>
#include <utility>

#include "display/sync/mutex.h"

namespace voxeld::daemon::assets {
namespace {

sync::Mutex asked_mutex;
std::shared_ptr<const std::function<int(DiskCall)>> asked VOXELD_GUARDED_BY(asked_mutex);

int Answer(DiskCall call) {
  std::shared_ptr<const std::function<int(DiskCall)>> answer;
  {
    const sync::MutexLock lock(asked_mutex);
    answer = asked;
  }
  return answer == nullptr ? 0 : (*answer)(call);
}

// Returns how many bytes the system may transfer; nullopt: the call fails with errno set.
std::optional<size_t> Ask(DiskCall call, size_t size) {
  const int answer = Answer(call);
  if (answer == 0) return size;
  if (answer == DiskCalls::kOneByte) return std::min<size_t>(size, 1);
  errno = answer;
  return std::nullopt;
}

}  // namespace

DiskCalls::DiskCalls(std::function<int(DiskCall)> answer) {
  const sync::MutexLock lock(asked_mutex);
  asked = std::make_shared<const std::function<int(DiskCall)>>(std::move(answer));
}

DiskCalls::~DiskCalls() {
  const sync::MutexLock lock(asked_mutex);
  asked = nullptr;
}

}  // namespace voxeld::daemon::assets

using voxeld::daemon::assets::Ask;
using voxeld::daemon::assets::DiskCall;

// These replace the C library's functions.
extern "C" {

ssize_t pread(int file, void* bytes, size_t size, off_t offset) {
  const auto some = Ask(DiskCall::kRead, size);
  return some.has_value() ? syscall(SYS_pread64, file, bytes, *some, offset) : -1;
}

ssize_t pwrite(int file, const void* bytes, size_t size, off_t offset) {
  const auto some = Ask(DiskCall::kWrite, size);
  return some.has_value() ? syscall(SYS_pwrite64, file, bytes, *some, offset) : -1;
}

int fsync(int file) {
  return Ask(DiskCall::kSync, 0).has_value() ? static_cast<int>(syscall(SYS_fsync, file)) : -1;
}

}  // extern "C"
