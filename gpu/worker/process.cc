#include "gpu/worker/process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstring>
#include <string_view>
#include <system_error>
#include <thread>

#include "absl/strings/str_cat.h"
#include "gpu/worker/message.h"

extern char** environ;

namespace voxeld::gpu {

absl::StatusOr<std::shared_ptr<WorkerProcess>> WorkerProcess::ConnectTo(const std::string& path) {
  const auto failed = [&path](int error) {
    return absl::FailedPreconditionError(absl::StrCat("no worker at the socket ", path, ": ",
                                                      std::generic_category().message(error)));
  };
  sockaddr_un address = {};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) return failed(ENAMETOOLONG);
  std::memcpy(address.sun_path, path.data(), path.size());
  const int control = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (control < 0) return failed(errno);
  if (connect(control, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    const int error = errno;
    close(control);
    return failed(error);
  }
  return std::shared_ptr<WorkerProcess>(new WorkerProcess(0, control));
}

absl::StatusOr<std::shared_ptr<WorkerProcess>> WorkerProcess::Start(const std::string& program) {
  if (constexpr std::string_view kSocket = "unix:"; program.starts_with(kSocket)) {
    return ConnectTo(program.substr(kSocket.size()));
  }
  int sockets[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, sockets) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("no sockets for ", program, ": ", std::generic_category().message(errno)));
  }
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_adddup2(&files, sockets[1], kWorkerSocket);
  posix_spawn_file_actions_addclosefrom_np(&files, kWorkerSocket + 1);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::string name = program;
  char* arguments[] = {name.data(), nullptr};
  pid_t pid = 0;
  const int error = posix_spawn(&pid, program.c_str(), &files, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  close(sockets[1]);
  if (error != 0) {
    close(sockets[0]);
    return absl::FailedPreconditionError(
        absl::StrCat(program, " cannot be started: ", std::generic_category().message(error)));
  }
  fcntl(sockets[0], F_SETFL, O_NONBLOCK);
  return std::shared_ptr<WorkerProcess>(new WorkerProcess(pid, sockets[0]));
}

WorkerProcess::~WorkerProcess() {
  Kill();
  close(control_);
}

absl::StatusOr<int> WorkerProcess::Connect() {
  int sockets[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, sockets) != 0) {
    return absl::UnavailableError(
        absl::StrCat("no sockets for a worker: ", std::generic_category().message(errno)));
  }
  Message message;
  message.type = MessageType::kConnect;
  message.fd = sockets[1];
  const absl::Status sent = SendMessage(control_, message);
  close(sockets[1]);
  if (!sent.ok()) {
    close(sockets[0]);
    return absl::UnavailableError(sent.message());
  }
  fcntl(sockets[0], F_SETFL, O_NONBLOCK);
  return sockets[0];
}

void WorkerProcess::Kill() {
  if (killed_.exchange(true)) return;
  if (pid_ == 0) {
    shutdown(control_, SHUT_RDWR);
    return;
  }
  kill(pid_, SIGKILL);
  // A process that hangs in its driver dies when the driver returns.
  try {
    std::thread([pid = pid_] {
      while (waitpid(pid, nullptr, 0) < 0 && errno == EINTR) {
      }
    }).detach();
  } catch (const std::system_error&) {
    waitpid(pid_, nullptr, WNOHANG);  // without a thread, it may stay a zombie
  }
}

bool WorkerProcess::lost() const {
  if (killed_) return true;
  pollfd end{control_, POLLIN, 0};
  return poll(&end, 1, 0) > 0 && (end.revents & (POLLHUP | POLLERR)) != 0;
}

std::string DefaultWorkerProgram(const std::filesystem::path& running) {
  const std::filesystem::path folder = running.parent_path();
  const std::filesystem::path above = folder.parent_path();
  const std::filesystem::path installed = above / "libexec/voxeld";
  for (const std::filesystem::path& place : {folder, above, installed}) {
    for (const char* name : {"voxeld-engine-cuda", "voxeld-engine"}) {
      std::error_code error;
      if (std::filesystem::exists(place / name, error)) return place / name;
    }
  }
  return installed / "voxeld-engine";
}

std::filesystem::path RunningProgram() {
  char path[PATH_MAX];
  const ssize_t size = readlink("/proc/self/exe", path, sizeof(path));
  return std::string(path, static_cast<size_t>(std::max<ssize_t>(0, size)));
}

}  // namespace voxeld::gpu
