// A worker's process.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Killed at the latest with this object. Thread-safe.
class WorkerProcess {
 public:
  // Starts `program` with its end of a socket pair as descriptor 3, and nothing else open but the
  // standard streams. FailedPrecondition if it cannot be started.
  static absl::StatusOr<std::unique_ptr<WorkerProcess>> Start(const std::string& program);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  int socket() const { return socket_; }  // this end; blocks
  pid_t pid() const { return pid_; }

 private:
  WorkerProcess(pid_t pid, int socket) : pid_(pid), socket_(socket) {}

  const pid_t pid_;
  const int socket_;
};

inline constexpr int kWorkerSocket = 3;

}  // namespace voxeld::gpu
