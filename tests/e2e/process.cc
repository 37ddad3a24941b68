#include "tests/e2e/process.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>

extern char** environ;

namespace voxeld::e2e {
namespace {

using std::chrono::steady_clock;

// True if `fd` became readable (or its other end closed) in time.
bool Readable(int fd, steady_clock::time_point deadline) {
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - steady_clock::now());
    pollfd poll_fd = {fd, POLLIN, 0};
    const int n = poll(&poll_fd, 1, static_cast<int>(std::max<int64_t>(0, left.count())));
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
  for (const auto& [name, value] : all) out.push_back(std::string(name).append("=").append(value));
  return out;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> out;
  for (std::string& text : texts) out.push_back(text.data());
  out.push_back(nullptr);
  return out;
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments,
                 const std::map<std::string, std::string>& environment) {
  int ends[2];
  EXPECT_EQ(pipe2(ends, O_CLOEXEC), 0);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
  posix_spawn_file_actions_adddup2(&actions, ends[1], 2);
  std::vector<std::string> argv = arguments, envp = Environment(environment);
  const int error = posix_spawn(&pid_, argv[0].c_str(), &actions, nullptr, Pointers(argv).data(),
                                Pointers(envp).data());
  EXPECT_EQ(error, 0) << argv[0];
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  pipe_ = ends[0];
  pidfd_ = static_cast<int>(syscall(SYS_pidfd_open, pid_, 0));
  EXPECT_GE(pidfd_, 0);
}

Process::~Process() {
  if (!code_.has_value()) {
    Signal(SIGKILL);
    Wait();
  }
  close(pidfd_);
  close(pipe_);
}

void Process::Signal(int signal) {
  if (!code_.has_value()) kill(pid_, signal);
}

bool Process::ReadSome(steady_clock::time_point deadline) {
  if (!Readable(pipe_, deadline)) return false;
  char buffer[4096];
  const ssize_t n = read(pipe_, buffer, sizeof(buffer));
  if (n <= 0) return false;
  output_.append(buffer, static_cast<size_t>(n));
  return true;
}

std::optional<std::string> Process::ReadLine() {
  const auto deadline = steady_clock::now() + kPatience;
  for (;;) {
    const size_t end = output_.find('\n', read_);
    if (end != std::string::npos) {
      std::string line = output_.substr(read_, end - read_);
      read_ = end + 1;
      return line;
    }
    if (!ReadSome(deadline)) return {};
  }
}

std::optional<std::string> Process::ReadLineWith(const std::string& text) {
  for (;;) {
    std::optional<std::string> line = ReadLine();
    if (!line.has_value() || line->find(text) != std::string::npos) return line;
  }
}

std::optional<int> Process::Wait(std::chrono::milliseconds limit) {
  if (code_.has_value()) return code_;
  // A full pipe must not hold it up.
  const auto deadline = steady_clock::now() + limit;
  while (ReadSome(deadline)) {
  }
  if (!Readable(pidfd_, deadline)) return {};
  int status = 0;
  EXPECT_EQ(waitpid(pid_, &status, 0), pid_);
  code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  return code_;
}

Ended RunToEnd(const std::vector<std::string>& arguments,
               const std::map<std::string, std::string>& environment) {
  Process process(arguments, environment);
  const std::optional<int> code = process.Wait();
  EXPECT_TRUE(code.has_value()) << "did not end: " << process.output();
  return {code.value_or(-1), process.output()};
}

}  // namespace voxeld::e2e
