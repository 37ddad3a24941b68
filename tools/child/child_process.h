// A child process with its output, for tools and tests that run the project's programs.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::child {

// Where the child's standard error goes; its standard output is always read here.
enum class Errors : uint8_t {
  kWithOutput,  // into output()
  kApart,       // into errors(), read by Wait()
  kInherited,   // where this process's goes
};

struct ChildOptions {
  std::map<std::string, std::string> environment;  // over this process's own
  Errors errors = Errors::kWithOutput;
  // For each line, and for the end.
  std::chrono::milliseconds patience{60'000};
};

// Bound to one thread. A child that still runs is killed on destruction. It starts with no signal
// blocked and nothing on its standard input.
class ChildProcess {
 public:
  // `arguments[0]` is the program's path. Errors: what the system said.
  static absl::StatusOr<std::unique_ptr<ChildProcess>> Start(
      const std::vector<std::string>& arguments, ChildOptions options = {});
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }

  void Signal(int signal);

  // The next line of its output, without the newline; nothing at the end, or when patience has run
  // out.
  std::optional<std::string> ReadLine();
  // The first further line that has `text` in it.
  std::optional<std::string> ReadLineWith(const std::string& text);

  // Reads to its end. The exit code, or −signal; nothing if it did not end in `limit` (without one:
  // patience).
  std::optional<int> Wait(std::optional<std::chrono::milliseconds> limit = {});

  // All that it has said so far (after Wait: all).
  const std::string& output() const { return output_.text; }
  const std::string& errors() const { return errors_.text; }

 private:
  struct Pipe {
    int fd = -1;
    bool ended = false;
    std::string text;
  };

  explicit ChildProcess(ChildOptions options) : options_(std::move(options)) {}
  absl::Status Spawn(const std::vector<std::string>& arguments);
  // Reads what comes next on either pipe; false at the end of both, or at the deadline.
  bool ReadSome(std::chrono::steady_clock::time_point deadline);

  const ChildOptions options_;
  pid_t pid_ = -1;
  int pidfd_ = -1;
  Pipe output_, errors_;
  std::optional<int> code_;
  size_t read_ = 0;  // of output, by ReadLine
};

// A folder of its own, removed with all that is in it.
class TemporaryFolder {
 public:
  // "NAME-XXXXXX" in the system's folder for such.
  static absl::StatusOr<TemporaryFolder> Make(const std::string& name);
  ~TemporaryFolder();
  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;

  const std::string& path() const { return path_; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;  // empty: moved from
};

// For a program that must see nothing of the machine's own configuration, but `folder`.
std::map<std::string, std::string> CleanEnvironment(const std::string& folder);

}  // namespace voxeld::child
