#include "tools/child/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

extern char** environ;

namespace voxeld::child {
namespace {

using std::chrono::steady_clock;

int MillisecondsTo(steady_clock::time_point deadline) {
  const auto left =
      std::chrono::duration_cast<std::chrono::milliseconds>(deadline - steady_clock::now());
  return static_cast<int>(std::max<int64_t>(0, left.count()));
}

// Returns true if one of `fds` became readable (or its other end was closed) in time.
bool Readable(std::vector<pollfd>& fds, steady_clock::time_point deadline) {
  for (;;) {
    const int n = poll(fds.data(), fds.size(), MillisecondsTo(deadline));
    if (n > 0) return true;
    if (n == 0 || errno != EINTR) return false;
  }
}

std::vector<std::string> Environment(const std::map<std::string, std::string>& over) {
  std::map<std::string, std::string> all;
  for (char** at = environ; *at != nullptr; ++at) {
    const std::string pair = *at;
    const size_t equals = pair.find('=');
    if (equals != std::string::npos) all[pair.substr(0, equals)] = pair.substr(equals + 1);
  }
  for (const auto& [name, value] : over) all[name] = value;
  std::vector<std::string> out;
  out.reserve(all.size());
  for (const auto& [name, value] : all) out.push_back(absl::StrCat(name, "=", value));
  return out;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> out;
  out.reserve(texts.size() + 1);
  for (std::string& text : texts) out.push_back(text.data());
  out.push_back(nullptr);
  return out;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ChildProcess>> ChildProcess::Start(
    const std::vector<std::string>& arguments, ChildOptions options) {
  std::unique_ptr<ChildProcess> child(new ChildProcess(std::move(options)));
  if (absl::Status status = child->Spawn(arguments); !status.ok()) return status;
  return child;
}

absl::Status ChildProcess::Spawn(const std::vector<std::string>& arguments) {
  std::array<int, 2> out = {-1, -1}, errors = {-1, -1};
  const bool apart = options_.errors == Errors::kApart;
  if (pipe2(out.data(), O_CLOEXEC) != 0 || (apart && pipe2(errors.data(), O_CLOEXEC) != 0)) {
    return absl::ErrnoToStatus(errno, absl::StrCat("no pipe for ", arguments[0]));
  }
  output_.fd = out[0];
  errors_.fd = errors[0];
  errors_.ended = !apart;

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out[1], 1);
  if (options_.errors != Errors::kInherited) {
    posix_spawn_file_actions_adddup2(&actions, apart ? errors[1] : out[1], 2);
  }
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  std::vector<std::string> argv = arguments, envp = Environment(options_.environment);
  const int error = posix_spawn(&pid_, argv[0].c_str(), &actions, &attributes,
                                Pointers(argv).data(), Pointers(envp).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  close(out[1]);
  if (apart) close(errors[1]);
  if (error != 0) {
    pid_ = -1;
    return absl::ErrnoToStatus(error, absl::StrCat(arguments[0], " could not be started"));
  }
  pidfd_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
  if (pidfd_ < 0) return absl::ErrnoToStatus(errno, "no descriptor of a process");
  return absl::OkStatus();
}

ChildProcess::~ChildProcess() {
  if (pid_ > 0 && !code_.has_value()) {
    Signal(SIGKILL);
    Wait();
  }
  for (const int fd : {pidfd_, output_.fd, errors_.fd}) {
    if (fd >= 0) close(fd);
  }
}

void ChildProcess::Signal(int signal) {
  if (!code_.has_value()) kill(pid_, signal);
}

bool ChildProcess::ReadSome(steady_clock::time_point deadline) {
  std::vector<pollfd> fds;
  std::vector<Pipe*> pipes;
  for (Pipe* pipe : {&output_, &errors_}) {
    if (pipe->ended) continue;
    fds.push_back({pipe->fd, POLLIN, 0});
    pipes.push_back(pipe);
  }
  if (fds.empty() || !Readable(fds, deadline)) return false;
  for (size_t i = 0; i < fds.size(); ++i) {
    if (fds[i].revents == 0) continue;
    std::array<char, 4096> buffer;
    const ssize_t n = read(fds[i].fd, buffer.data(), buffer.size());
    if (n > 0) {
      pipes[i]->text.append(buffer.data(), static_cast<size_t>(n));
    } else {
      pipes[i]->ended = true;
    }
  }
  return true;
}

std::optional<std::string> ChildProcess::ReadLine() {
  const auto deadline = steady_clock::now() + options_.patience;
  for (;;) {
    const size_t end = output_.text.find('\n', read_);
    if (end != std::string::npos) {
      std::string line = output_.text.substr(read_, end - read_);
      read_ = end + 1;
      return line;
    }
    if (!ReadSome(deadline)) return {};
  }
}

std::optional<std::string> ChildProcess::ReadLineWith(const std::string& text) {
  for (;;) {
    std::optional<std::string> line = ReadLine();
    if (!line.has_value() || line->find(text) != std::string::npos) return line;
  }
}

std::optional<int> ChildProcess::Wait(std::optional<std::chrono::milliseconds> limit) {
  if (code_.has_value()) return code_;
  // Keeps reading, because a full pipe would block the child.
  const auto deadline = steady_clock::now() + limit.value_or(options_.patience);
  while (ReadSome(deadline)) {
  }
  std::vector<pollfd> ended = {{pidfd_, POLLIN, 0}};
  if (!Readable(ended, deadline)) return {};
  int status = 0;
  if (waitpid(pid_, &status, 0) != pid_) return {};
  code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  return code_;
}

absl::StatusOr<TemporaryFolder> TemporaryFolder::Make(const std::string& name) {
  std::error_code error;
  const std::filesystem::path parent = std::filesystem::temp_directory_path(error);
  std::string path = (parent / absl::StrCat(name, "-XXXXXX")).string();
  if (error || mkdtemp(path.data()) == nullptr) {
    return absl::ErrnoToStatus(error ? error.value() : errno,
                               absl::StrCat("no temporary folder ", path));
  }
  return TemporaryFolder(std::move(path));
}

TemporaryFolder::TemporaryFolder(TemporaryFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})) {}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
}

std::map<std::string, std::string> CleanEnvironment(const std::string& folder) {
  return {{"HOME", folder}, {"XDG_CONFIG_HOME", folder}, {"XDG_RUNTIME_DIR", folder}};
}

}  // namespace voxeld::child
