#include "tools/voxelctl/import/contained.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "daemon/address/descriptor.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/model_bytes.h"
#include "tools/voxelctl/import/reader_process.h"
#include "tools/voxelctl/import/sandbox.h"

namespace voxeld::voxelctl {
namespace {

absl::Status NoSandbox(const SourceFile& file, const absl::Status& why) {
  return absl::FailedPreconditionError(
      absl::StrCat(EscapeForTerminal(file.path), ": is not read, since ", why.message(),
                   "; Linux 5.13 or later with Landlock and seccomp is expected"));
}

// Closes all descriptors except the standard streams and `kept`, which becomes kAnswerDescriptor.
// Requires: called in the child.
void KeepOnly(int kept, pid_t parent) {
  // The child is killed when the thread that waits for it ends, and that may have happened already.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGABRT, SIGSEGV, SIGBUS, SIGFPE})
    ::signal(signal, SIG_DFL);
  // Moved above the numbers of the streams first, so that no dup2 closes it.
  const int aside = ::fcntl(kept, F_DUPFD, kAnswerDescriptor);
  // The reader must not use this process's connections, and people should not see a library's
  // messages.
  const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  if (aside != kAnswerDescriptor) ::dup2(aside, kAnswerDescriptor);
  ::close_range(kAnswerDescriptor + 1, ~0U, 0);
}

// Waits for `child` to exit. Returns: its state, as waitpid reports it.
int Await(pid_t child) {
  int state = 0;
  while (::waitpid(child, &state, 0) < 0 && errno == EINTR) {
  }
  return state;
}

absl::Status NoReader(const SourceFile& file) {
  return absl::ResourceExhaustedError(
      absl::StrCat(EscapeForTerminal(file.path),
                   ": cannot run the process that reads it: ", std::strerror(errno)));
}

// Returns: why a reader that ended in this state failed; OK if it succeeded.
absl::Status EndOf(const SourceFile& file, int state) {
  if (WIFSIGNALED(state)) {
    const int signal = WTERMSIG(state);
    if (signal == SIGINT || signal == SIGTERM) return absl::CancelledError("interrupted");
    if (signal == SIGKILL)
      return Spoilt(file, "was killed, as the system does when memory is short");
    return Spoilt(file, absl::StrCat("crashed (", ::strsignal(signal), ")"));
  }
  if (WEXITSTATUS(state) == kNotConfined) {
    return NoSandbox(file, absl::UnavailableError("its reader could not be confined"));
  }
  if (WEXITSTATUS(state) == kNotStarted) {
    return absl::UnavailableError(absl::StrCat(
        EscapeForTerminal(file.path),
        ": could not start voxeld-import, which reads it; reinstall the package voxeld-import"));
  }
  if (WEXITSTATUS(state) != 0) return Spoilt(file, "wanted more than 4 GiB of memory, or gave up");
  return absl::OkStatus();
}

// A process that reads, and this process's end of the socket to it.
class Reader {
 public:
  Reader(absl::string_view path, Interrupt* interrupt, const ReaderLimits& limits)
      : file_{.path = std::string(path), .extension = {}, .bytes = {}},
        interrupt_(interrupt),
        limits_(limits) {}
  ~Reader() {
    if (child_ <= 0) return;
    ::kill(child_, SIGKILL);
    Await(child_);
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  absl::Status Start(const ReaderMain& reader) {
    int ends[2] = {-1, -1};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return NoReader(file_);
    socket_ = daemon::Descriptor(ends[0]);
    const daemon::Descriptor other(ends[1]);
    const pid_t parent = ::getpid();
    child_ = ::fork();
    if (child_ < 0) return NoReader(file_);
    if (child_ == 0) {
      KeepOnly(other.get(), parent);
      reader();
      ::_exit(1);
    }
    return absl::OkStatus();
  }

  // Requests a frame from a reader that serves frames. Errors are ignored, because a reader that
  // has exited or no longer accepts numbers does not answer either.
  void Ask(int64_t frame) {
    (void)::send(socket_.get(), &frame, sizeof(frame), MSG_NOSIGNAL | MSG_DONTWAIT);
  }

  // Returns: the reader's next answer, of at most `most_bytes`, parsed by `read` (ReadModel,
  // ReadFrameCount). An invalid answer ends the reader; its error is also that of all later
  // answers.
  template <typename T>
  absl::StatusOr<T> Answer(uint64_t most_bytes,
                           absl::Status (*read)(const SourceFile&, const TakeBytes&,
                                                absl::StatusOr<T>*)) {
    if (!ended_.ok()) return ended_;
    most_bytes_ = most_bytes;
    taken_ = 0;
    until_ = Now() + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                         std::chrono::duration<double>(limits_.reading_s));
    const int listener = interrupt_ == nullptr ? 0 : interrupt_->AddListener([child = child_] {
      ::kill(child, SIGKILL);
    });
    absl::StatusOr<T> answer = Spoilt(file_, "gave up");
    const absl::Status whole = read(
        file_, [this](void* out, size_t size) { return Take(out, size); }, &answer);
    // CPU time that the reader uses between requests counts for the next frame.
    used_s_ = ProcessorSeconds();
    if (interrupt_ != nullptr) interrupt_->RemoveListener(listener);
    if (whole.ok()) return answer;
    // The exit status of a reader that has exited gives the reason, unless it is killed here first.
    if (!closed_) ::kill(child_, SIGKILL);
    const absl::Status end = EndOf(file_, Await(std::exchange(child_, -1)));
    ended_ = interrupt_ != nullptr && interrupt_->requested() ? absl::CancelledError("interrupted")
             : !over_.ok()                                    ? over_
             : closed_ && !end.ok()                           ? end
                                                              : whole;
    return ended_;
  }

 private:
  static std::chrono::steady_clock::time_point Now() { return std::chrono::steady_clock::now(); }

  // Implements TakeBytes for the socket, within the limits. Small pieces are read from a buffer.
  bool Take(void* out, size_t size) {
    char* at = static_cast<char*>(out);
    while (size > 0) {
      if (begin_ == end_ && size >= buffer_.size()) {
        const size_t got = Receive(at, size);
        if (got == 0) return false;
        at += got, size -= got;
        continue;
      }
      if (begin_ == end_) {
        begin_ = 0;
        end_ = Receive(buffer_.data(), buffer_.size());
        if (end_ == 0) return false;
      }
      const size_t some = std::min(size, end_ - begin_);
      std::memcpy(at, buffer_.data() + begin_, some);
      at += some, size -= some, begin_ += some;
    }
    return true;
  }

  // Returns: how many bytes were received, at most `size`; 0 if the reader has exited (`closed_`)
  // or exceeded a limit (`over_`).
  size_t Receive(char* out, size_t size) {
    while (!closed_ && over_.ok()) {
      pollfd ready = {socket_.get(), POLLIN, 0};
      constexpr int kLookAgainMs = 250;  // interval at which the time limits are checked
      const int found = ::poll(&ready, 1, kLookAgainMs);
      if (ProcessorSeconds() - used_s_ > limits_.processor_s) {
        over_ = TimedOut(limits_.processor_s, " of processor time");
      } else if (Now() >= until_) {
        over_ = TimedOut(limits_.reading_s, "");
      } else if (taken_ > most_bytes_) {
        over_ = Spoilt(file_, absl::StrCat("made more than ", most_bytes_, " bytes"));
      }
      if (!over_.ok() || found <= 0) continue;
      const ssize_t got = ::recv(socket_.get(), out, size, MSG_DONTWAIT);
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      closed_ = got <= 0;
      if (closed_) break;
      taken_ += static_cast<size_t>(got);
      return static_cast<size_t>(got);
    }
    return 0;
  }

  absl::Status TimedOut(double seconds, absl::string_view of) const {
    return Spoilt(file_, absl::StrCat("timed out after ", seconds, " s", of));
  }

  double ProcessorSeconds() const {
    clockid_t clock = 0;
    timespec used = {};
    if (::clock_getcpuclockid(child_, &clock) != 0 || ::clock_gettime(clock, &used) != 0) return 0;
    return static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) * 1e-9;
  }

  const SourceFile file_;  // without its bytes
  Interrupt* const interrupt_;
  const ReaderLimits limits_;
  daemon::Descriptor socket_;
  pid_t child_ = -1;
  std::vector<char> buffer_ = std::vector<char>(16 << 10);
  size_t begin_ = 0, end_ = 0;  // the unread part of the buffer
  double used_s_ = 0;           // CPU time at its last answer
  absl::Status ended_;          // why the reader has ended

  // State of the current answer.
  std::chrono::steady_clock::time_point until_;
  uint64_t taken_ = 0, most_bytes_ = 0;

  bool closed_ = false;  // whether the reader's end of the socket is closed
  absl::Status over_;    // the limit that was exceeded
};

class ContainedFrames final : public FrameSource {
 public:
  ContainedFrames(SourceFile file, Interrupt* interrupt, const ReaderLimits& limits)
      : file_(std::move(file)), limits_(limits), reader_(file_.path, interrupt, limits) {}

  absl::Status Open(const ReaderMain& reader) {
    if (absl::Status status = reader_.Start(reader); !status.ok()) return status;
    file_.bytes = std::string();  // the reader has them
    const absl::StatusOr<int64_t> count = reader_.Answer(limits_.frame_bytes, ReadFrameCount);
    if (!count.ok()) return count.status();
    if (*count < 1 || *count > kMaxFrames)
      return Spoilt(file_, absl::StrCat("counts ", *count, " frames"));
    count_ = *count;
    return absl::OkStatus();
  }

  int64_t count() const override { return count_; }

  absl::StatusOr<Model> Read(int64_t frame) override {
    reader_.Ask(frame);
    absl::StatusOr<Model> model = reader_.Answer(limits_.frame_bytes, ReadModel);
    if (!model.ok()) return model;
    const absl::Status sound = CheckModel(file_, *model);
    if (!sound.ok())
      return absl::Status(sound.code(), absl::StrCat(sound.message(), " (in frame ", frame, ")"));
    return model;
  }

 private:
  SourceFile file_;
  const ReaderLimits limits_;
  Reader reader_;
  int64_t count_ = 1;
};

absl::Status CheckSandbox(const SourceFile& file) {
  const absl::Status landlock = Sandbox::Get().CheckLandlock();
  if (file.other_files == OtherFiles::kNone && !landlock.ok()) return NoSandbox(file, landlock);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Model> ReadContained(SourceFile& file, const ReaderMain& reader,
                                    Interrupt* interrupt, const ReaderLimits& limits) {
  if (absl::Status status = CheckSandbox(file); !status.ok()) return status;
  Reader process(file.path, interrupt, limits);
  if (absl::Status status = process.Start(reader); !status.ok()) return status;
  file.bytes = std::string();
  return process.Answer(limits.model_bytes, ReadModel);
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenContained(SourceFile file,
                                                           const ReaderMain& reader,
                                                           Interrupt* interrupt,
                                                           const ReaderLimits& limits) {
  if (absl::Status status = CheckSandbox(file); !status.ok()) return status;
  auto frames = std::make_unique<ContainedFrames>(std::move(file), interrupt, limits);
  if (absl::Status status = frames->Open(reader); !status.ok()) return status;
  return frames;
}

}  // namespace voxeld::voxelctl
