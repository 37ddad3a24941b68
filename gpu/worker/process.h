// A worker's process: one for all engines of a GPU, each with a connection of its own.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace voxeld::gpu {

// The process is killed when this object is destroyed, at the latest. Thread-safe.
class WorkerProcess {
 public:
  // Starts `program` with its end of a socket pair as descriptor 3, and nothing else open except
  // the standard streams. Or, if `program` is unix:PATH, connects to a socket (SOCK_SEQPACKET)
  // whose listener starts a process for each connection, for example a service manager that
  // isolates it. Errors: FailedPrecondition if neither is possible.
  static absl::StatusOr<std::shared_ptr<WorkerProcess>> Start(const std::string& program);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  // Opens a connection for one engine. Returns this end of it, which the caller closes and which
  // does not block; the other end is sent to the process. Errors: Unavailable if the process is
  // gone.
  absl::StatusOr<int> Connect();
  // Kills the process, whatever it is doing, and does not wait for it. Its connections end too. For
  // a process that someone else started, it closes the connection, which makes the process exit
  // unless it is stopped.
  void Kill();
  // Returns whether the process has exited or been killed.
  bool lost() const;
  pid_t pid() const { return pid_; }  // 0: started by someone else

 private:
  WorkerProcess(pid_t pid, int control) : pid_(pid), control_(control) {}
  static absl::StatusOr<std::shared_ptr<WorkerProcess>> ConnectTo(const std::string& path);

  const pid_t pid_;
  const int control_;  // new connections are sent over this socket
  std::atomic<bool> killed_{false};
};

inline constexpr int kWorkerSocket = 3;

// Returns the program that is started unless the options name another. Looks in the folder of the
// program `running`, in the one above (a build's tests) and in ../libexec/voxeld (installed), in each
// for voxeld-engine-cuda, which has both engines, and then for voxeld-engine, which has the CPU's
// alone. Returns the first that exists, and ../libexec/voxeld/voxeld-engine if none does.
std::string DefaultWorkerProgram(const std::filesystem::path& running);
// Returns the path of this process's own program.
std::filesystem::path RunningProgram();

}  // namespace voxeld::gpu
