#include "tests/daemon/assets/disk_calls.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <utility>

#include "display/sync/mutex.h"

namespace voxeld::daemon::assets {
namespace {

sync::Mutex asked_mutex;
std::shared_ptr<const std::function<int(DiskCall)>> asked VOXELD_GUARDED_BY(asked_mutex);

// Whether it is to fail; errno says why.
bool Fails(DiskCall call) {
  std::shared_ptr<const std::function<int(DiskCall)>> answer;
  {
    const sync::MutexLock lock(asked_mutex);
    answer = asked;
  }
  const int error = answer == nullptr ? 0 : (*answer)(call);
  if (error != 0) errno = error;
  return error != 0;
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

using voxeld::daemon::assets::DiskCall;
using voxeld::daemon::assets::Fails;

// In place of the C library's.
extern "C" {

ssize_t pread(int file, void* bytes, size_t size, off_t offset) {
  if (Fails(DiskCall::kRead)) return -1;
  return syscall(SYS_pread64, file, bytes, size, offset);
}

ssize_t pwrite(int file, const void* bytes, size_t size, off_t offset) {
  if (Fails(DiskCall::kWrite)) return -1;
  return syscall(SYS_pwrite64, file, bytes, size, offset);
}

int fsync(int file) {
  if (Fails(DiskCall::kSync)) return -1;
  return static_cast<int>(syscall(SYS_fsync, file));
}

}  // extern "C"
