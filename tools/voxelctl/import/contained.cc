#include "tools/voxelctl/import/contained.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"

// Sanitizers reserve more address space than the limit.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define VOXELD_SHADOW_MEMORY
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define VOXELD_SHADOW_MEMORY
#endif
#endif

namespace voxeld::voxelctl {
namespace {

[[maybe_unused]] constexpr rlim_t kMostMemory = rlim_t{4} << 30;
constexpr rlim_t kMostSeconds = 120;
constexpr unsigned kMostWaiting = 600;  // s

class Writer {
 public:
  explicit Writer(int descriptor) : descriptor_(descriptor) {}
  bool ok() const { return ok_; }

  void Bytes(const void* bytes, size_t size) {
    const char* at = static_cast<const char*>(bytes);
    while (size > 0 && ok_) {
      const ssize_t written = ::write(descriptor_, at, size);
      if (written < 0 && errno == EINTR) continue;
      ok_ = written > 0;
      if (ok_) at += written, size -= static_cast<size_t>(written);
    }
  }
  template <typename Vector>
  void All(const Vector& values) {
    const uint64_t count = values.size();
    Bytes(&count, sizeof(count));
    Bytes(values.data(), count * sizeof(values[0]));
  }

 private:
  const int descriptor_;
  bool ok_ = true;
};

class Reader {
 public:
  Reader(const char* at, size_t size) : at_(at), left_(size) {}
  bool ok() const { return ok_; }

  void Bytes(void* out, size_t size) {
    ok_ &= size <= left_;
    if (!ok_ || size == 0) return;
    std::memcpy(out, at_, size);
    at_ += size;
    left_ -= size;
  }
  template <typename Vector>
  void All(Vector* values) {
    uint64_t count = 0;
    Bytes(&count, sizeof(count));
    ok_ &= count <= left_ / sizeof((*values)[0]);
    if (!ok_) return;
    values->resize(count);
    Bytes(values->data(), count * sizeof((*values)[0]));
  }

 private:
  const char* at_;
  size_t left_;
  bool ok_ = true;
};

bool WriteModel(const absl::StatusOr<Model>& model, int descriptor) {
  Writer writer(descriptor);
  const uint8_t good = model.ok();
  writer.Bytes(&good, 1);
  if (!good) {
    writer.All(std::string(model.status().message()));
    return writer.ok();
  }
  const uint64_t parts = model->parts.size();
  writer.Bytes(&model->up, sizeof(model->up));
  writer.All(model->format);
  writer.All(model->note);
  writer.Bytes(&parts, sizeof(parts));
  for (const Part& part : model->parts) {
    writer.Bytes(&part.kind, sizeof(part.kind));
    writer.Bytes(&part.thickness, sizeof(part.thickness));
    writer.Bytes(&part.level, sizeof(part.level));
    writer.All(part.positions);
    writer.All(part.normals);
    writer.All(part.colors);
    writer.All(part.indices);
  }
  return writer.ok();
}

absl::Status Spoilt(const SourceFile& file, absl::string_view how) {
  return FileError(file, absl::StrCat("the library that reads it ", how),
                   "the file is damaged or not what its name says");
}

absl::StatusOr<Model> ReadModel(const SourceFile& file, const char* bytes, size_t size) {
  Reader reader(bytes, size);
  uint8_t good = 0;
  reader.Bytes(&good, 1);
  if (!good) {
    std::string message;
    reader.All(&message);
    return reader.ok() ? absl::InvalidArgumentError(message) : Spoilt(file, "gave up");
  }
  Model model;
  model.path = file.path;
  uint64_t parts = 0;
  reader.Bytes(&model.up, sizeof(model.up));
  reader.All(&model.format);
  reader.All(&model.note);
  reader.Bytes(&parts, sizeof(parts));
  for (uint64_t i = 0; i < parts && reader.ok(); ++i) {
    Part part;
    reader.Bytes(&part.kind, sizeof(part.kind));
    reader.Bytes(&part.thickness, sizeof(part.thickness));
    reader.Bytes(&part.level, sizeof(part.level));
    reader.All(&part.positions);
    reader.All(&part.normals);
    reader.All(&part.colors);
    reader.All(&part.indices);
    model.parts.push_back(std::move(part));
  }
  if (!reader.ok()) return Spoilt(file, "gave up halfway");
  return model;
}

[[noreturn]] void RunChild(const std::function<bool(int)>& write, int descriptor, pid_t parent) {
  // Ends with the thread that waits for it, which may have ended already.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGALRM, SIGABRT, SIGSEGV, SIGBUS, SIGFPE})
    ::signal(signal, SIG_DFL);
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  // What the library says is not for people, and what this process had yet to say is not said twice.
  for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
    if (nowhere >= 0) ::dup2(nowhere, stream);
  }
  const rlimit core = {0, 0}, seconds = {kMostSeconds, kMostSeconds};
  ::setrlimit(RLIMIT_CORE, &core);
  ::setrlimit(RLIMIT_CPU, &seconds);
  ::alarm(kMostWaiting);
#if !defined(VOXELD_SHADOW_MEMORY)
  const rlimit memory = {kMostMemory, kMostMemory};
  ::setrlimit(RLIMIT_AS, &memory);
#endif
  bool good = false;
  try {
    good = write(descriptor);
  } catch (const std::exception&) {
  }
  ::_exit(good ? 0 : 1);
}

// What `write` puts into the descriptor that it is given, as `take` reads it.
template <typename Taken>
absl::StatusOr<Taken> Run(const SourceFile& file, const std::function<bool(int)>& write,
                          const std::function<absl::StatusOr<Taken>(const char*, size_t)>& take) {
  const int descriptor = ::memfd_create("voxelctl-model", MFD_CLOEXEC);
  if (descriptor < 0) {
    return absl::ResourceExhaustedError(absl::StrCat(file.path, ": ", std::strerror(errno)));
  }
  const absl::Cleanup close = [descriptor] { ::close(descriptor); };
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) {
    return absl::ResourceExhaustedError(absl::StrCat(file.path, ": ", std::strerror(errno)));
  }
  if (child == 0) RunChild(write, descriptor, parent);
  int state = 0;
  while (::waitpid(child, &state, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(state)) {
    const int signal = WTERMSIG(state);
    if (signal == SIGINT || signal == SIGTERM) return absl::CancelledError("interrupted");
    if (signal == SIGXCPU || signal == SIGKILL || signal == SIGALRM)
      return Spoilt(file, absl::StrCat("did not end within ", kMostSeconds, " s of the processor"));
    return Spoilt(file, absl::StrCat("crashed (", ::strsignal(signal), ")"));
  }
  if (WEXITSTATUS(state) != 0) return Spoilt(file, "wanted more than 4 GiB of memory, or gave up");
  const off_t size = ::lseek(descriptor, 0, SEEK_END);
  if (size <= 0) return Spoilt(file, "gave up");
  void* bytes = ::mmap(nullptr, static_cast<size_t>(size), PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (bytes == MAP_FAILED) {
    return absl::ResourceExhaustedError(absl::StrCat(file.path, ": ", std::strerror(errno)));
  }
  absl::StatusOr<Taken> taken = take(static_cast<const char*>(bytes), static_cast<size_t>(size));
  ::munmap(bytes, static_cast<size_t>(size));
  return taken;
}

}  // namespace

absl::StatusOr<Model> ReadContained(const SourceFile& file,
                                    const std::function<absl::StatusOr<Model>()>& read) {
  return Run<Model>(
      file, [&read](int descriptor) { return WriteModel(read(), descriptor); },
      [&file](const char* bytes, size_t size) { return ReadModel(file, bytes, size); });
}

absl::StatusOr<std::string> ReadBytesContained(
    const SourceFile& file, const std::function<absl::StatusOr<std::string>()>& read) {
  return Run<std::string>(
      file,
      [&read](int descriptor) {
        const absl::StatusOr<std::string> all = read();
        Writer writer(descriptor);
        const uint8_t good = all.ok();
        writer.Bytes(&good, 1);
        writer.All(good ? *all : std::string(all.status().message()));
        return writer.ok();
      },
      [&file](const char* bytes, size_t size) -> absl::StatusOr<std::string> {
        Reader reader(bytes, size);
        uint8_t good = 0;
        std::string all;
        reader.Bytes(&good, 1);
        reader.All(&all);
        if (!reader.ok()) return Spoilt(file, "gave up");
        if (!good) return absl::InvalidArgumentError(all);
        return all;
      });
}

}  // namespace voxeld::voxelctl
