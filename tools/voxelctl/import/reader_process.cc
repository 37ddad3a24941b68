#include "tools/voxelctl/import/reader_process.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/address/descriptor.h"
#include "tools/voxelctl/import/model_bytes.h"
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
constexpr rlim_t kMostDescriptors = 64;

// Variables that libraries read could change what a file looks like, or load code, so only these
// are kept: for the user's own fonts, for programs that find their libraries this way, and for
// sanitizers.
constexpr const char* kKeptVariables[] = {"HOME", "LD_LIBRARY_PATH", "ASAN_OPTIONS", "LSAN_OPTIONS",
                                          "UBSAN_OPTIONS"};

// Returns the folder below which the reader may open files: that of the file, or the one that is
// read.
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

// Returns the address space in bytes that this process uses. Builds with a sanitizer do not call
// it, because they have no limit on address space.
[[maybe_unused]] rlim_t AddressSpace() {
  const daemon::Descriptor file(::open("/proc/self/statm", O_RDONLY | O_CLOEXEC));
  char text[64] = {};
  if (::read(file.get(), text, sizeof(text) - 1) <= 0) return 0;
  return std::strtoull(text, nullptr, 10) * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE));
}

// Reads a whole number from a socket. Returns false at the end.
bool ReadNumber(int descriptor, int64_t* number) {
  ssize_t got = 0;
  do {
    got = ::read(descriptor, number, sizeof(*number));
  } while (got < 0 && errno == EINTR);
  return got == sizeof(*number);
}

}  // namespace

bool ConfineReader(const SourceFile& file, const std::vector<std::string>& folders) {
  const Sandbox& sandbox = Sandbox::Get();  // creates a file in memory when it is made
  Limit(RLIMIT_CORE, 0);
  Limit(RLIMIT_NOFILE, kMostDescriptors);
  Limit(RLIMIT_FSIZE, 0);
#if !defined(VOXELD_SHADOW_MEMORY)
  Limit(RLIMIT_AS, AddressSpace() + kMostMemory + kOfFile * file.bytes.size());
#endif
  // For a file of the user's own, the sandbox is a second line of defence: without Landlock the
  // first remains.
  return sandbox.Enter(Readable(file), folders).ok() || file.other_files != OtherFiles::kNone;
}

ReaderMain ReaderOf(SourceFile& file, std::function<absl::StatusOr<Model>()> read) {
  return [&file, read = std::move(read)] {
    if (!ConfineReader(file)) ::_exit(kNotConfined);
    AnswerModel([&] {
      absl::StatusOr<Model> model = read();
      file.bytes = std::string();
      return model;
    });
  };
}

ReaderMain FramesOf(SourceFile file, OpenFrames open) {
  return [file = std::move(file), open = std::move(open)] {
    if (!ConfineReader(file)) ::_exit(kNotConfined);
    ServeFrames([&] { return open(file); });
  };
}

ReaderMain ProgramOf(std::vector<std::string> command) {
  return [command = std::move(command)]() mutable {
    std::vector<char*> words;
    for (std::string& word : command) words.push_back(word.data());
    words.push_back(nullptr);
    std::vector<std::string> kept;
    for (const char* name : kKeptVariables) {
      if (const char* value = std::getenv(name); value != nullptr)
        kept.push_back(absl::StrCat(name, "=", value));
    }
    std::vector<char*> environment;
    environment.reserve(kept.size() + 1);
    for (std::string& variable : kept) environment.push_back(variable.data());
    environment.push_back(nullptr);
    ::execve(words[0], words.data(), environment.data());
    ::_exit(kNotStarted);
  };
}

void AnswerModel(const std::function<absl::StatusOr<Model>()>& read) {
  bool good = false;
  try {
    good = WriteModel(read(), kAnswerDescriptor);
  } catch (const std::exception&) {
  }
  ::_exit(good ? 0 : 1);
}

void ServeFrames(const std::function<absl::StatusOr<std::unique_ptr<FrameSource>>()>& open) {
  bool good = true;
  try {
    const absl::StatusOr<std::unique_ptr<FrameSource>> source = open();
    good =
        WriteFrameCount(source.ok() ? absl::StatusOr<int64_t>((*source)->count()) : source.status(),
                        kAnswerDescriptor);
    for (int64_t frame = 0; good && source.ok() && ReadNumber(kAnswerDescriptor, &frame);)
      good = WriteModel((*source)->Read(frame), kAnswerDescriptor);
  } catch (const std::exception&) {
    good = false;
  }
  ::_exit(good ? 0 : 1);
}

}  // namespace voxeld::voxelctl
