#include "daemon/play/player.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/strip.h"
#include "daemon/address/descriptor.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::play {
namespace {

using std::chrono::steady_clock;

// Terminates a process when the thread that started it ends for any reason. Part of every Linux
// system.
constexpr char kSetpriv[] = "/usr/bin/setpriv";
// The only variables that the process gets. It must not see tokens and addresses in the daemon's
// environment.
constexpr const char* kEnvironment[] = {"PATH", "LANG", "LC_ALL", "LC_CTYPE", "TMPDIR", "TZ"};
constexpr size_t kKeptErrors = 8192;
constexpr int kFirstToGo = 500;  // of 1000
constexpr char kErrorLine[] = "voxelctl: ";

struct Child {
  PlayFile file;
  pid_t pid = 0;
  Descriptor ended, errors;  // readable after the exit; its standard error
  std::string said;          // the last part of its standard error
};

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> out;
  out.reserve(texts.size() + 1);
  for (std::string& text : texts) out.push_back(text.data());
  out.push_back(nullptr);
  return out;
}

absl::StatusOr<Child> Spawn(const PlayerOptions& options, PlayFile file) {
  std::array<int, 2> pipe;
  if (pipe2(pipe.data(), O_CLOEXEC) != 0) return absl::ErrnoToStatus(errno, "no pipe");
  Child child{.file = std::move(file), .errors = Descriptor(pipe[0])};
  const Descriptor write_end(pipe[1]);
  fcntl(pipe[0], F_SETFL, O_NONBLOCK);

  std::vector<std::string> words;
  if (access(kSetpriv, X_OK) == 0) words = {kSetpriv, "--pdeathsig", "KILL", "--"};
  for (const std::string& word :
       {options.program, std::string("--server"), options.server, std::string("play"),
        std::string("--clear"), std::string("--other-files"), std::string("none"),
        child.file.path()}) {
    words.push_back(word);
  }
  std::vector<std::string> environment;
  for (const char* name : kEnvironment) {
    if (const char* value = std::getenv(name))
      environment.push_back(absl::StrCat(name, "=", value));
  }
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&files, pipe[1], STDERR_FILENO);
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes,
                           POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  const int error = posix_spawn(&child.pid, words[0].c_str(), &files, &attributes,
                                Pointers(words).data(), Pointers(environment).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) return absl::ErrnoToStatus(error, absl::StrCat(words[0], " cannot be started"));
  child.ended = Descriptor(static_cast<int>(syscall(SYS_pidfd_open, child.pid, 0)));
  if (!child.ended.ok()) {
    const int why = errno;
    kill(-child.pid, SIGKILL);
    waitpid(child.pid, nullptr, 0);
    return absl::ErrnoToStatus(why, "no descriptor of a process");
  }
  std::ofstream(absl::StrCat("/proc/", child.pid, "/oom_score_adj")) << kFirstToGo;
  return child;
}

// Shortens the text to `most` bytes without splitting a code point.
std::string Shortened(std::string text, size_t most) {
  if (text.size() <= most) return text;
  constexpr char kMore[] = "…";
  size_t end = most - std::strlen(kMore);
  while (end > 0 && (text[end] & 0xc0) == 0x80) --end;
  return text.substr(0, end) + kMore;
}

// Returns: the last error that the process printed, including its continuation lines, with the
// client's name of the file.
std::string WhyOf(const Child& child, int status) {
  size_t begin = child.said.rfind(absl::StrCat("\n", kErrorLine));
  begin = begin != std::string::npos ? begin + 1 : child.said.starts_with(kErrorLine) ? 0 : begin;
  std::string why;
  if (begin != std::string::npos) {
    why = child.said.substr(begin + std::strlen(kErrorLine));
    why = absl::StrReplaceAll(why, {{child.file.prefix(), ""}, {"\n", " "}});
    absl::RemoveExtraAsciiWhitespace(&why);
  }
  if (!why.empty()) return Shortened(std::move(why), kLongestWhy);
  if (WIFSIGNALED(status)) {
    return absl::StrCat("voxelctl was ended by signal ", WTERMSIG(status), " (",
                        strsignal(WTERMSIG(status)), ")");
  }
  return absl::StrCat("voxelctl ended with ", WEXITSTATUS(status), " and did not say why");
}

}  // namespace

class Player::Impl {
 public:
  // `wake` is a non-blocking eventfd.
  Impl(PlayerOptions options, Descriptor wake)
      : options_(std::move(options)), wake_(std::move(wake)), thread_([this] { Run(); }) {}

  ~Impl() { End(); }

  void Play(PlayFile file) {
    std::function<void()> tell;
    {
      const sync::MutexLock lock(mutex_);
      if (quit_) return;
      state_ = {.name = file.name()};
      next_ = std::move(file);
      stop_ = false;
      tell = on_change_;
    }
    Wake();
    if (tell) tell();
  }

  void Stop() {
    {
      const sync::MutexLock lock(mutex_);
      next_.reset();
      stop_ = true;
    }
    Wake();
  }

  void End() {
    {
      const sync::MutexLock lock(mutex_);
      next_.reset();
      quit_ = true;
    }
    Wake();
    const sync::MutexLock lock(join_mutex_);
    if (thread_.joinable()) thread_.join();
  }

  Playing state() const {
    const sync::MutexLock lock(mutex_);
    return state_;
  }

  void SetOnChange(std::function<void()> on_change) {
    const sync::MutexLock lock(mutex_);
    on_change_ = std::move(on_change);
  }

 private:
  void Wake() {
    const uint64_t one = 1;
    (void)!write(wake_.get(), &one, sizeof(one));
  }

  // Call on the player's thread. Sets the state of the last file, unless another file is about to
  // replace it.
  void Tell(Playing state) {
    std::function<void()> tell;
    {
      const sync::MutexLock lock(mutex_);
      if (next_.has_value()) return;
      if (state == state_) return;
      state_ = std::move(state);
      tell = on_change_;
    }
    if (tell) tell();
  }

  void Run() {
    if (options_.remove_left) PrivateFolder::RemoveLeft();
    for (;;) {
      uint64_t count = 0;
      (void)!read(wake_.get(), &count, sizeof(count));
      std::optional<PlayFile> next;
      bool stop = false, quit = false;
      {
        const sync::MutexLock lock(mutex_);
        next = std::exchange(next_, std::nullopt);
        stop = std::exchange(stop_, false);
        quit = quit_;
      }
      if (next.has_value() || stop || quit) EndChild();
      if (quit) return Tell({});
      if (stop && !next.has_value()) Tell({});
      if (next.has_value()) StartChild(*std::move(next));
      Await(-1, true);
      if (child_.has_value() && HasEnded(0)) Reap();
    }
  }

  void StartChild(PlayFile file) {
    const std::string name = file.name();
    absl::StatusOr<Child> child = Spawn(options_, std::move(file));
    if (!child.ok()) {
      return Tell({.failed = name, .why = std::string(child.status().message())});
    }
    child_ = *std::move(child);
    Tell({.name = name});
  }

  // Waits until the process prints something or exits, for at most `milliseconds` (−1: no limit).
  // `asked`: also until another thread calls Wake.
  void Await(int milliseconds, bool asked) {
    std::array<pollfd, 3> fds = {{{wake_.get(), POLLIN, 0}, {-1, POLLIN, 0}, {-1, POLLIN, 0}}};
    if (!asked) fds[0].fd = -1;
    if (child_.has_value()) {
      fds[1].fd = child_->ended.get();
      fds[2].fd = child_->errors.get();
    }
    if (poll(fds.data(), fds.size(), milliseconds) > 0 && fds[2].revents != 0) Listen();
  }

  bool HasEnded(int milliseconds) const {
    pollfd end = {child_->ended.get(), POLLIN, 0};
    return poll(&end, 1, milliseconds) > 0;
  }

  void Listen() {
    std::array<char, 4096> buffer;
    for (;;) {
      const ssize_t n = read(child_->errors.get(), buffer.data(), buffer.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0 && errno == EAGAIN) return;
      if (n <= 0) return child_->errors.Reset(-1);
      child_->said.append(buffer.data(), static_cast<size_t>(n));
      if (child_->said.size() > kKeptErrors) {
        child_->said.erase(0, child_->said.size() - kKeptErrors);
      }
      if (static_cast<size_t>(n) < buffer.size()) return;
    }
  }

  // Handles a process that has exited by itself.
  void Reap() {
    if (child_->errors.ok()) Listen();
    const int status = TakeAway();
    const std::string name = child_->file.name();
    const std::string why = WhyOf(*child_, status);
    child_.reset();
    const bool good = WIFEXITED(status) && WEXITSTATUS(status) == 0;
    Tell(good ? Playing() : Playing{.failed = name, .why = why});
  }

  // Kills the remaining process group. Its id cannot be reused before waitpid.
  int TakeAway() {
    int status = 0;
    kill(-child_->pid, SIGKILL);
    while (waitpid(child_->pid, &status, 0) < 0 && errno == EINTR) {
    }
    return status;
  }

  void EndChild() {
    if (!child_.has_value()) return;
    kill(-child_->pid, SIGTERM);
    const auto deadline = steady_clock::now() + std::chrono::nanoseconds(options_.grace_ns);
    while (!HasEnded(0)) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
          deadline - steady_clock::now() + std::chrono::microseconds(999));
      if (left.count() <= 0) break;
      Await(static_cast<int>(left.count()), false);
    }
    TakeAway();
    child_.reset();
  }

  const PlayerOptions options_;
  const Descriptor wake_;
  mutable sync::Mutex mutex_;
  sync::Mutex join_mutex_;
  std::optional<PlayFile> next_ VOXELD_GUARDED_BY(mutex_);
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false, quit_ VOXELD_GUARDED_BY(mutex_) = false;
  Playing state_ VOXELD_GUARDED_BY(mutex_);
  std::function<void()> on_change_ VOXELD_GUARDED_BY(mutex_);
  std::optional<Child> child_;  // used by the player's thread only
  std::thread thread_;
};

absl::StatusOr<std::unique_ptr<Player>> Player::Make(PlayerOptions options) {
  Descriptor wake(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!wake.ok()) return absl::ErrnoToStatus(errno, "no descriptor for playing files");
  try {
    return std::unique_ptr<Player>(
        new Player(std::make_unique<Impl>(std::move(options), std::move(wake))));
  } catch (const std::system_error& error) {
    return absl::ResourceExhaustedError(
        absl::StrCat("no thread for playing files: ", error.what()));
  }
}
Player::Player(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Player::~Player() = default;
void Player::Play(PlayFile file) { impl_->Play(std::move(file)); }
void Player::Stop() { impl_->Stop(); }
void Player::End() { impl_->End(); }
Playing Player::state() const { return impl_->state(); }
void Player::SetOnChange(std::function<void()> on_change) {
  impl_->SetOnChange(std::move(on_change));
}

}  // namespace voxeld::daemon::play
