// The running workers, so that all engines of a GPU share one.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <tuple>

#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "gpu/engine.h"
#include "gpu/worker/process.h"

namespace voxeld::gpu {

// Thread-safe. A process lives as long as an engine uses it.
class WorkerPool {
 public:
  // Returns the process of this program for that kind of engine and device. Starts a new one if
  // none is running or if it was lost.
  absl::StatusOr<std::shared_ptr<WorkerProcess>> Acquire(const std::string& program,
                                                         EngineKind kind, int device);

 private:
  using Key = std::tuple<std::string, EngineKind, int>;
  sync::Mutex mutex_;
  std::map<Key, std::weak_ptr<WorkerProcess>> processes_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::gpu
