#include "tools/voxelctl/import/contained.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <system_error>
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

// Of a frame of an animation, which this process copies.
constexpr off_t kMostFrameBytes = off_t{1} << 30;

absl::Status NoSandbox(const SourceFile& file, const absl::Status& why) {
  return absl::FailedPreconditionError(
      absl::StrCat(EscapeForTerminal(file.path), ": is not read, since ", why.message(),
                   "; Linux 5.13 or later with Landlock and seccomp is expected"));
}

// Call it in the child. Closes all descriptors except the standard streams and `kept`, which are renumbered in order from kModel on.
void KeepOnly(std::span<const int> kept, pid_t parent) {
  // Ends with the thread that waits for it, which may have ended already.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGALRM, SIGABRT, SIGSEGV, SIGBUS, SIGFPE})
    ::signal(signal, SIG_DFL);
  // The connections of this process are not for the reader. What a library says is not for people.
  const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  // Move all of them above the target numbers first, so that no dup2 closes one that is still needed.
  constexpr int kAside = 32;
  int next = kModelDescriptor;
  std::vector<int> aside;
  for (const int descriptor : kept) aside.push_back(::fcntl(descriptor, F_DUPFD, kAside));
  for (const int descriptor : aside) ::dup2(descriptor, next++);
  ::close_range(static_cast<unsigned>(next), ~0U, 0);
}

// Waits for the end of `child`, which `interrupt` brings about.
int Await(pid_t child, Interrupt* interrupt) {
  const int listener =
      interrupt == nullptr ? 0 : interrupt->AddListener([child] { ::kill(child, SIGKILL); });
  siginfo_t info;
  while (::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT) < 0 &&
         errno == EINTR) {
  }
  // Its number is its own until it has been waited for.
  if (interrupt != nullptr) interrupt->RemoveListener(listener);
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

absl::Status TimedOut(const SourceFile& file, unsigned seconds, absl::string_view of) {
  return Spoilt(file, absl::StrCat("timed out after ", seconds, " s", of));
}

// Returns: why a reader that ended in this state did not do what it should; OK if it did.
absl::Status EndOf(const SourceFile& file, int state) {
  if (WIFSIGNALED(state)) {
    const int signal = WTERMSIG(state);
    if (signal == SIGINT || signal == SIGTERM) return absl::CancelledError("interrupted");
    if (signal == SIGXCPU) return TimedOut(file, kMostProcessorSeconds, " of processor time");
    if (signal == SIGALRM) return TimedOut(file, kMostReadingSeconds, "");
    if (signal == SIGKILL)
      return Spoilt(file, "was killed, as the system does when memory is short");
    if (signal == SIGXFSZ) return Spoilt(file, "made more than a model may hold");
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

// The whole of `size` bytes. False if there are fewer.
bool ReadAll(int descriptor, void* out, size_t size) {
  char* at = static_cast<char*>(out);
  while (size > 0) {
    const ssize_t got = ::read(descriptor, at, size);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got, size -= static_cast<size_t>(got);
  }
  return true;
}

class ContainedFrames final : public FrameSource {
 public:
  ContainedFrames(SourceFile file, Interrupt* interrupt)
      : file_(std::move(file)), interrupt_(interrupt) {}
  ~ContainedFrames() override {
    if (child_ <= 0) return;
    ::kill(child_, SIGKILL);
    Await(child_, nullptr);
  }

  absl::Status Start(const ReaderMain& reader) {
    model_ = daemon::Descriptor(::memfd_create("voxelctl-frame", MFD_CLOEXEC));
    int ends[2] = {-1, -1};
    if (!model_.ok() || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
      return NoReader(file_);
    }
    channel_ = daemon::Descriptor(ends[0]);
    const daemon::Descriptor other(ends[1]);
    const pid_t parent = ::getpid();
    child_ = ::fork();
    if (child_ < 0) return NoReader(file_);
    if (child_ == 0) {
      KeepOnly({{model_.get(), other.get()}}, parent);
      reader();
      ::_exit(1);
    }
    file_.bytes = std::string();  // the reader has them
    return absl::OkStatus();
  }

  // Waits for the source to be opened.
  absl::Status Opened() {
    const absl::StatusOr<int64_t> count = Answer();
    if (!count.ok()) return count.status();
    if (*count > kMaxFrames) return Spoilt(file_, absl::StrCat("counts ", *count, " frames"));
    if (*count >= 1) {
      count_ = *count;
      return absl::OkStatus();
    }
    const absl::StatusOr<Model> error = Written();
    return error.ok() ? Spoilt(file_, "gave up") : error.status();
  }

  int64_t count() const override { return count_; }

  absl::StatusOr<Model> Read(int64_t frame) override {
    if (!ended_.ok()) return ended_;
    // The reader shares the file offset, so it writes from the beginning again.
    if (::ftruncate(model_.get(), 0) != 0 || ::lseek(model_.get(), 0, SEEK_SET) != 0) {
      return NoReader(file_);
    }
    // A reader that has ended, or does not take numbers any more, does not answer either.
    (void)::send(channel_.get(), &frame, sizeof(frame), MSG_NOSIGNAL | MSG_DONTWAIT);
    const absl::StatusOr<int64_t> answer = Answer();
    if (!answer.ok()) return answer.status();
    absl::StatusOr<Model> model = Written();
    if (!model.ok()) return model;
    const absl::Status sound = CheckModel(file_, *model);
    if (!sound.ok())
      return absl::Status(sound.code(), absl::StrCat(sound.message(), " (in frame ", frame, ")"));
    return model;
  }

 private:
  // Waits for an answer, as long as the reader is within its limits.
  absl::StatusOr<int64_t> Answer() {
    if (!ended_.ok()) return ended_;
    const int listener = interrupt_ == nullptr ? 0 : interrupt_->AddListener([child = child_] {
      ::kill(child, SIGKILL);
    });
    int64_t answer = 0;
    bool answered = false;
    absl::Status over;
    for (unsigned waited = 0; over.ok(); ++waited) {
      pollfd ready = {channel_.get(), POLLIN, 0};
      constexpr int kSecondMs = 1000;  // after which its time is looked at
      const int found = ::poll(&ready, 1, kSecondMs);
      if (found > 0) {
        // The reader writes eight bytes at once. It must not keep this process waiting for the rest.
        const ssize_t got = ::recv(channel_.get(), &answer, sizeof(answer), MSG_DONTWAIT);
        answered = got == sizeof(answer);
        if (got > 0 && !answered) over = Spoilt(file_, "gave up halfway");
        break;
      }
      if (waited >= kMostReadingSeconds) over = TimedOut(file_, kMostReadingSeconds, "");
      if (ProcessorSeconds() - used_ > static_cast<double>(kMostProcessorSeconds)) {
        over = TimedOut(file_, kMostProcessorSeconds, " of processor time");
      }
    }
    // What the reader uses while it is not asked for a frame counts for the next one.
    used_ = ProcessorSeconds();
    if (interrupt_ != nullptr) interrupt_->RemoveListener(listener);
    if (answered) return answer;
    ::kill(child_, SIGKILL);
    const absl::Status end = EndOf(file_, Await(std::exchange(child_, -1), nullptr));
    ended_ = interrupt_ != nullptr && interrupt_->requested() ? absl::CancelledError("interrupted")
             : !over.ok()                                     ? over
             : end.ok()                                       ? Spoilt(file_, "gave up")
                                                              : end;
    return ended_;
  }

  double ProcessorSeconds() const {
    clockid_t clock = 0;
    timespec used = {};
    if (::clock_getcpuclockid(child_, &clock) != 0 || ::clock_gettime(clock, &used) != 0) return 0;
    return static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) * 1e-9;
  }

  // Returns: the model that the reader has written. The bytes are copied, not mapped, because the running reader could truncate the file.
  absl::StatusOr<Model> Written() const {
    const off_t size = ::lseek(model_.get(), 0, SEEK_END);
    if (size <= 0) return Spoilt(file_, "gave up");
    if (size > kMostFrameBytes) {
      return Spoilt(file_, absl::StrCat("made a frame of ", size, " bytes, and ", kMostFrameBytes,
                                        " are possible"));
    }
    const auto bytes = std::make_unique_for_overwrite<char[]>(static_cast<size_t>(size));
    if (::lseek(model_.get(), 0, SEEK_SET) != 0 ||
        !ReadAll(model_.get(), bytes.get(), static_cast<size_t>(size))) {
      return Spoilt(file_, "gave up halfway");
    }
    return ReadModel(file_, bytes.get(), static_cast<size_t>(size));
  }

  SourceFile file_;
  Interrupt* const interrupt_;
  daemon::Descriptor model_, channel_;
  pid_t child_ = -1;
  int64_t count_ = 1;
  double used_ = 0;     // s of processor time, when it last answered
  absl::Status ended_;  // why the reader is not there any more
};

}  // namespace

absl::StatusOr<Model> ReadContained(const SourceFile& file, const ReaderMain& reader,
                                    Interrupt* interrupt) {
  const absl::Status landlock = Sandbox::Get().CheckLandlock();
  if (file.other_files == OtherFiles::kNone && !landlock.ok()) return NoSandbox(file, landlock);
  const daemon::Descriptor descriptor(::memfd_create("voxelctl-model", MFD_CLOEXEC));
  if (!descriptor.ok()) return NoReader(file);
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) return NoReader(file);
  if (child == 0) {
    KeepOnly({{descriptor.get()}}, parent);
    reader();
    ::_exit(1);
  }
  const int state = Await(child, interrupt);
  if (interrupt != nullptr && interrupt->requested()) return absl::CancelledError("interrupted");
  if (absl::Status end = EndOf(file, state); !end.ok()) return end;
  const off_t size = ::lseek(descriptor.get(), 0, SEEK_END);
  if (size <= 0) return Spoilt(file, "gave up");
  void* bytes =
      ::mmap(nullptr, static_cast<size_t>(size), PROT_READ, MAP_PRIVATE, descriptor.get(), 0);
  if (bytes == MAP_FAILED) return NoReader(file);
  absl::StatusOr<Model> model =
      ReadModel(file, static_cast<const char*>(bytes), static_cast<size_t>(size));
  ::munmap(bytes, static_cast<size_t>(size));
  return model;
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenContained(SourceFile file,
                                                           const ReaderMain& reader,
                                                           Interrupt* interrupt) {
  const absl::Status landlock = Sandbox::Get().CheckLandlock();
  if (file.other_files == OtherFiles::kNone && !landlock.ok()) return NoSandbox(file, landlock);
  auto frames = std::make_unique<ContainedFrames>(std::move(file), interrupt);
  if (absl::Status status = frames->Start(reader); !status.ok()) return status;
  if (absl::Status status = frames->Opened(); !status.ok()) return status;
  return frames;
}

}  // namespace voxeld::voxelctl
