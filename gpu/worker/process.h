// A worker's process: one for all engines of a GPU, each with a connection of its own.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace voxeld::gpu {

// Killed at the latest with this object. Thread-safe.
class WorkerProcess {
 public:
  // Starts `program` with its end of a socket pair as descriptor 3, and nothing else open but the
  // standard streams. Or, where `program` is unix:PATH, connects to a socket (SOCK_SEQPACKET) whose
  // listener starts one for each connection, as a service manager does that keeps it apart.
  // FailedPrecondition if neither can be done.
  static absl::StatusOr<std::shared_ptr<WorkerProcess>> Start(const std::string& program);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  // A connection for one engine: this end of it, the caller's to close; it does not block. The
  // other is on its way to the process. Unavailable if that is gone.
  absl::StatusOr<int> Connect();
  // Ends the process, whatever it does; nobody waits for it. Its connections end with it. One that
  // somebody else has started is told to end by its connection's end, which a stopped one does not hear.
  void Kill();
  // It has ended, or been killed.
  bool lost() const;
  pid_t pid() const { return pid_; }  // 0: somebody else's

 private:
  WorkerProcess(pid_t pid, int control) : pid_(pid), control_(control) {}
  static absl::StatusOr<std::shared_ptr<WorkerProcess>> ConnectTo(const std::string& path);

  const pid_t pid_;
  const int control_;  // connections go over this
  std::atomic<bool> killed_{false};
};

inline constexpr int kWorkerSocket = 3;

// Returns the program that is started unless the options name another. Looks in the folder of the
// program `running`, in the one above (a build's tests) and in ../libexec/voxeld (installed), in each
// for voxeld-engine-cuda, which has both engines, and then for voxeld-engine, which has the CPU's
// alone. Returns the first that exists, and ../libexec/voxeld/voxeld-engine if none does.
std::string DefaultWorkerProgram(const std::filesystem::path& running);
// This process's own.
std::filesystem::path RunningProgram();

}  // namespace voxeld::gpu
