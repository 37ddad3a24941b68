#include "gpu/worker/worker_pool.h"

namespace voxeld::gpu {

absl::StatusOr<std::shared_ptr<WorkerProcess>> WorkerPool::Acquire(const std::string& program,
                                                                   EngineKind kind, int device) {
  sync::MutexLock lock(mutex_);
  std::weak_ptr<WorkerProcess>& known = processes_[{program, kind, device}];
  if (std::shared_ptr<WorkerProcess> there = known.lock(); there != nullptr && !there->lost()) {
    return there;
  }
  absl::StatusOr<std::shared_ptr<WorkerProcess>> fresh = WorkerProcess::Start(program);
  if (fresh.ok()) known = *fresh;
  return fresh;
}

}  // namespace voxeld::gpu
