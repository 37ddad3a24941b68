#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "tools/voxelctl/animate/moving_picture.h"
#include "tools/voxelctl/files/whole_file.h"

namespace voxeld::voxelctl {
namespace {

// The pipe to ffmpeg is a socket, so sending to an ffmpeg that has exited is an error and never a
// signal.
class Mp4 : public MovingPicture {
 public:
  Mp4(std::string path, std::unique_ptr<WholeFile> file)
      : path_(std::move(path)), file_(std::move(file)) {}

  ~Mp4() override {
    if (pid_ > 0) ::kill(pid_, SIGKILL);
    (void)End();
    if (said_ >= 0) ::close(said_);
  }

  absl::Status Start(double fps, int width, int height) {
    const std::string rate = absl::StrCat(fps), size = absl::StrCat(width, "x", height);
    const std::string out = absl::StrCat("file:", file_->temporary());
    const std::vector<const char*> arguments = {
        "ffmpeg",     "-hide_banner", "-loglevel", "error",     "-nostats",   "-f",
        "rawvideo",   "-pix_fmt",     "rgb24",     "-s",        size.c_str(), "-r",
        rate.c_str(), "-i",           "pipe:0",    "-an",       "-c:v",       "libx264",
        "-crf",       "18",           "-pix_fmt",  "yuv420p",   "-movflags",  "+faststart",
        "-f",         "mp4",          "-y",        out.c_str(), nullptr};
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
      return SystemError("ffmpeg gets no pipe");
    pipe_ = ends[0];
    const absl::Cleanup close_theirs = [&] { ::close(ends[1]); };
    said_ = ::memfd_create("ffmpeg", MFD_CLOEXEC);
    if (said_ < 0) return SystemError("there is no file for what ffmpeg says");

    posix_spawn_file_actions_t actions;
    ::posix_spawn_file_actions_init(&actions);
    const absl::Cleanup free_actions = [&] { ::posix_spawn_file_actions_destroy(&actions); };
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, said_, STDOUT_FILENO);
    ::posix_spawn_file_actions_adddup2(&actions, said_, STDERR_FILENO);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    const absl::Cleanup free_attributes = [&] { ::posix_spawnattr_destroy(&attributes); };
    sigset_t none, all;
    sigemptyset(&none);
    sigfillset(&all);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setsigdefault(&attributes, &all);
    // Ctrl-C at the terminal reaches only this program, which then ends ffmpeg.
    ::posix_spawnattr_setpgroup(&attributes, 0);
    ::posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    const int error = ::posix_spawnp(&pid_, arguments[0], &actions, &attributes,
                                     const_cast<char* const*>(arguments.data()), environ);
    if (error == 0) return absl::OkStatus();
    pid_ = -1;
    return absl::FailedPreconditionError(absl::StrCat(
        EscapeForTerminal(path_),
        ": an MP4 is made by the program ffmpeg, which cannot be started (", std::strerror(error),
        "); install it (on Debian: apt install ffmpeg), or take a .gif or numbered .png instead"));
  }

  absl::Status Add(const Image& image) override {
    const uint8_t* at = image.rgb.data();
    for (size_t left = image.rgb.size(); left > 0;) {
      const ssize_t sent = ::send(pipe_, at, left, MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent < 0) return Ended();
      at += sent;
      left -= static_cast<size_t>(sent);
    }
    return absl::OkStatus();
  }

  absl::Status Finish() override {
    if (End() != 0) return Ended();
    return file_->Commit();
  }

 private:
  absl::Status SystemError(const char* what) const {
    return absl::InternalError(
        absl::StrCat(EscapeForTerminal(path_), ": ", what, ": ", std::strerror(errno)));
  }

  // Waits for ffmpeg to exit. Returns its status as wait does.
  int End() {
    if (pipe_ >= 0) ::close(std::exchange(pipe_, -1));
    if (pid_ > 0) {
      while (::waitpid(pid_, &status_, 0) < 0 && errno == EINTR) {
      }
      pid_ = -1;
    }
    return status_;
  }

  // Returns the error of an ffmpeg that has exited or is about to; its last line gives the reason.
  absl::Status Ended() {
    (void)End();
    std::string text(4096, '\0');
    const off_t size = ::lseek(said_, 0, SEEK_END);
    const off_t from = std::max<off_t>(0, size - static_cast<off_t>(text.size()));
    const ssize_t got = ::pread(said_, text.data(), text.size(), from);
    text.resize(got > 0 ? static_cast<size_t>(got) : 0);
    const std::vector<std::string> lines = absl::StrSplit(text, '\n', absl::SkipWhitespace());
    return absl::FailedPreconditionError(
        absl::StrCat(EscapeForTerminal(path_), ": ffmpeg could not make it: ",
                     lines.empty() ? "it says nothing" : EscapeForTerminal(lines.back())));
  }

  const std::string path_;
  const std::unique_ptr<WholeFile> file_;
  pid_t pid_ = -1;
  int pipe_ = -1, said_ = -1, status_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<MovingPicture>> Mp4Movie(const std::string& path, double fps,
                                                        int width, int height) {
  absl::StatusOr<std::unique_ptr<WholeFile>> file = WholeFile::Create(path);
  if (!file.ok()) return file.status();
  auto movie = std::make_unique<Mp4>(path, *std::move(file));
  if (absl::Status status = movie->Start(fps, width, height); !status.ok()) return status;
  return movie;
}

}  // namespace voxeld::voxelctl
