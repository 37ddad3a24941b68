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
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "daemon/address/descriptor.h"
#include "tools/voxelctl/import/sandbox.h"

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

[[maybe_unused]] constexpr rlim_t kMostMemory = rlim_t{4} << 30, kOfFile = 4;
constexpr rlim_t kMostSeconds = 120, kMostDescriptors = 64;
constexpr unsigned kMostWaiting = 600;  // s
constexpr int kNoSandbox = 2;           // exit status
// Limit of what the reader may write: more than the largest model (kMaxModelVertices and the others).
constexpr rlim_t kMostModelBytes = rlim_t{5} << 30;
constexpr uint64_t kMostMessageBytes = 64 << 10;

class ModelWriter {
 public:
  explicit ModelWriter(int descriptor) : descriptor_(descriptor) {}
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

class ModelReader {
 public:
  ModelReader(const char* at, size_t size) : at_(at), left_(size) {}
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

void WriteVolume(const SampledVolume& volume, ModelWriter& writer) {
  const uint8_t has_window = volume.window.has_value();
  writer.Bytes(&volume.size, sizeof(volume.size));
  writer.Bytes(&volume.corners, sizeof(volume.corners));
  writer.Bytes(&has_window, 1);
  if (has_window) writer.Bytes(&*volume.window, sizeof(*volume.window));
  writer.All(volume.samples);
  writer.All(volume.colors);
}

SampledVolume ReadVolume(ModelReader& reader) {
  SampledVolume volume;
  uint8_t has_window = 0;
  reader.Bytes(&volume.size, sizeof(volume.size));
  reader.Bytes(&volume.corners, sizeof(volume.corners));
  reader.Bytes(&has_window, 1);
  if (has_window != 0) reader.Bytes(&volume.window.emplace(), sizeof(*volume.window));
  reader.All(&volume.samples);
  reader.All(&volume.colors);
  return volume;
}

bool WriteModel(const absl::StatusOr<Model>& model, int descriptor) {
  ModelWriter writer(descriptor);
  const int code = model.status().raw_code();
  writer.Bytes(&code, sizeof(code));
  if (!model.ok()) {
    writer.All(std::string(model.status().message()));
    return writer.ok();
  }
  const uint64_t parts = model->parts.size(), volumes = model->volumes.size();
  writer.All(model->path);
  writer.All(model->format);
  writer.All(model->note);
  writer.Bytes(&model->up, sizeof(model->up));
  writer.Bytes(&model->globe, sizeof(model->globe));
  writer.Bytes(&model->lit_already, sizeof(model->lit_already));
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
  writer.Bytes(&volumes, sizeof(volumes));
  for (const SampledVolume& volume : model->volumes) WriteVolume(volume, writer);
  return writer.ok();
}

absl::Status Spoilt(const SourceFile& file, absl::string_view how) {
  return FileError(file, absl::StrCat("the library that reads it ", how),
                   "the file is damaged or not what its name says");
}

// One of those that readers use.
absl::StatusCode CodeOf(int code) {
  switch (static_cast<absl::StatusCode>(code)) {
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kPermissionDenied:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kUnimplemented:
    case absl::StatusCode::kResourceExhausted:
      return static_cast<absl::StatusCode>(code);
    default:
      return absl::StatusCode::kInvalidArgument;
  }
}

// The writer may be in a stranger's hands, so enumerations are checked; ImportFile checks the rest (CheckModel).
absl::StatusOr<Model> ReadModel(const SourceFile& file, const char* bytes, size_t size) {
  ModelReader reader(bytes, size);
  int code = 0;
  reader.Bytes(&code, sizeof(code));
  if (code != 0) {
    std::string message;
    reader.All(&message);
    if (!reader.ok() || message.size() > kMostMessageBytes) return Spoilt(file, "gave up");
    return absl::Status(CodeOf(code), message);
  }
  Model model;
  uint64_t parts = 0, volumes = 0;
  uint8_t up = 0, globe = 0, lit_already = 0;
  reader.All(&model.path);
  reader.All(&model.format);
  reader.All(&model.note);
  reader.Bytes(&up, 1);
  reader.Bytes(&globe, 1);
  reader.Bytes(&lit_already, 1);
  if (up > static_cast<uint8_t>(Up::kZ)) return Spoilt(file, "gave up halfway");
  model.up = static_cast<Up>(up);
  model.globe = globe != 0;
  model.lit_already = lit_already != 0;
  reader.Bytes(&parts, sizeof(parts));
  for (uint64_t i = 0; i < parts && reader.ok(); ++i) {
    Part part;
    uint8_t kind = 0;
    reader.Bytes(&kind, 1);
    if (kind > static_cast<uint8_t>(Kind::kTriangles)) return Spoilt(file, "gave up halfway");
    part.kind = static_cast<Kind>(kind);
    reader.Bytes(&part.thickness, sizeof(part.thickness));
    reader.Bytes(&part.level, sizeof(part.level));
    reader.All(&part.positions);
    reader.All(&part.normals);
    reader.All(&part.colors);
    reader.All(&part.indices);
    model.parts.push_back(std::move(part));
  }
  reader.Bytes(&volumes, sizeof(volumes));
  for (uint64_t i = 0; i < volumes && reader.ok(); ++i) model.volumes.push_back(ReadVolume(reader));
  if (!reader.ok()) return Spoilt(file, "gave up halfway");
  return model;
}

// The folder below which the reader may open files: that of the file, or the one that is read.
std::string Readable(const SourceFile& file) {
  if (file.other_files == OtherFiles::kNone) return "";
  if (file.other_files == OtherFiles::kAny) return "/";
  std::error_code ignored;
  if (std::filesystem::is_directory(file.path, ignored)) return file.path;
  const std::string folder = std::filesystem::path(file.path).parent_path().string();
  return folder.empty() ? "." : folder;
}

void Limit(int resource, rlim_t most) {
  const rlimit limit = {most, most};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &limit);
}

// Bytes of address space that this process uses. Builds with a sanitizer do not call it: they have no
// limit on address space.
[[maybe_unused]] rlim_t AddressSpace() {
  const daemon::Descriptor file(::open("/proc/self/statm", O_RDONLY | O_CLOEXEC));
  char text[64] = {};
  if (::read(file.get(), text, sizeof(text) - 1) <= 0) return 0;
  return std::strtoull(text, nullptr, 10) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

[[noreturn]] void RunChild(const SourceFile& file,
                           const std::function<absl::StatusOr<Model>()>& read, int descriptor,
                           pid_t parent) {
  // Ends with the thread that waits for it, which may have ended already.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  sigset_t none;
  sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  for (const int signal : {SIGINT, SIGTERM, SIGALRM, SIGABRT, SIGSEGV, SIGBUS, SIGFPE})
    ::signal(signal, SIG_DFL);
  // The connections of this process are not for the reader. What a library says is not for people.
  constexpr int kModel = 3;
  const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  if (descriptor != kModel) ::dup2(descriptor, kModel);
  ::close_range(kModel + 1, ~0U, 0);
  Limit(RLIMIT_CORE, 0);
  Limit(RLIMIT_CPU, kMostSeconds);
  Limit(RLIMIT_NOFILE, kMostDescriptors);
  Limit(RLIMIT_FSIZE, kMostModelBytes);
#if !defined(VOXELD_SHADOW_MEMORY)
  Limit(RLIMIT_AS, AddressSpace() + kMostMemory + kOfFile * file.bytes.size());
#endif
  ::alarm(kMostWaiting);
  // For a file of the user's own the sandbox is a second line: without Landlock the first remains.
  const bool is_confined = Sandbox::Get().Enter(Readable(file)).ok();
  if (!is_confined && file.other_files == OtherFiles::kNone) ::_exit(kNoSandbox);
  bool good = false;
  try {
    good = WriteModel(read(), kModel);
  } catch (const std::exception&) {
  }
  ::_exit(good ? 0 : 1);
}

absl::Status NoSandbox(const SourceFile& file, const absl::Status& why) {
  return absl::FailedPreconditionError(
      absl::StrCat(EscapeForTerminal(file.path), ": is not read, since ", why.message(),
                   "; Linux 5.13 or later with Landlock and seccomp is expected"));
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

}  // namespace

absl::StatusOr<Model> ReadContained(const SourceFile& file,
                                    const std::function<absl::StatusOr<Model>()>& read,
                                    Interrupt* interrupt) {
  const absl::Status landlock = Sandbox::Get().CheckLandlock();
  if (file.other_files == OtherFiles::kNone && !landlock.ok()) return NoSandbox(file, landlock);
  const auto failed = [&file] {
    return absl::ResourceExhaustedError(
        absl::StrCat(EscapeForTerminal(file.path), ": ", std::strerror(errno)));
  };
  const daemon::Descriptor descriptor(::memfd_create("voxelctl-model", MFD_CLOEXEC));
  if (!descriptor.ok()) return failed();
  const pid_t parent = ::getpid();
  const pid_t child = ::fork();
  if (child < 0) return failed();
  if (child == 0) RunChild(file, read, descriptor.get(), parent);
  const int state = Await(child, interrupt);
  if (interrupt != nullptr && interrupt->requested()) return absl::CancelledError("interrupted");
  if (WIFSIGNALED(state)) {
    const int signal = WTERMSIG(state);
    if (signal == SIGINT || signal == SIGTERM) return absl::CancelledError("interrupted");
    if (signal == SIGXCPU)
      return Spoilt(file, absl::StrCat("did not end within ", kMostSeconds, " s of the processor"));
    if (signal == SIGALRM)
      return Spoilt(file, absl::StrCat("did not end within ", kMostWaiting, " s"));
    if (signal == SIGKILL)
      return Spoilt(file, "was killed, as the system does when memory is short");
    if (signal == SIGXFSZ) return Spoilt(file, "made more than a model may hold");
    return Spoilt(file, absl::StrCat("crashed (", ::strsignal(signal), ")"));
  }
  if (WEXITSTATUS(state) == kNoSandbox) {
    return NoSandbox(file, absl::UnavailableError("its reader could not be confined"));
  }
  if (WEXITSTATUS(state) != 0) return Spoilt(file, "wanted more than 4 GiB of memory, or gave up");
  const off_t size = ::lseek(descriptor.get(), 0, SEEK_END);
  if (size <= 0) return Spoilt(file, "gave up");
  void* bytes =
      ::mmap(nullptr, static_cast<size_t>(size), PROT_READ, MAP_PRIVATE, descriptor.get(), 0);
  if (bytes == MAP_FAILED) return failed();
  absl::StatusOr<Model> model =
      ReadModel(file, static_cast<const char*>(bytes), static_cast<size_t>(size));
  ::munmap(bytes, static_cast<size_t>(size));
  return model;
}

}  // namespace voxeld::voxelctl
