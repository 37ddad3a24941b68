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
  kInherited,   // to this process's standard error
};

struct ChildOptions {
  std::map<std::string, std::string> environment;  // on top of this process's own
  Errors errors = Errors::kWithOutput;
  // The time limit for each line, and for the exit.
  std::chrono::milliseconds patience{60'000};
};

// Bound to one thread. A child that is still running is killed on destruction. It starts with no
// signal blocked and with empty standard input.
class ChildProcess {
 public:
  // `arguments[0]` is the program's path. Errors: the system's error.
  static absl::StatusOr<std::unique_ptr<ChildProcess>> Start(
      const std::vector<std::string>& arguments, ChildOptions options = {});
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }

  void Signal(int signal);

  // Returns the next line of its output, without the newline; nothing at the end of the output or
  // when patience has run out.
  std::optional<std::string> ReadLine();
  // Returns the next line that contains `text`.
  std::optional<std::string> ReadLineWith(const std::string& text);

  // Reads all remaining output. Returns: the exit code, or −signal; nothing if the child did not
  // exit within `limit` (by default: patience).
  std::optional<int> Wait(std::optional<std::chrono::milliseconds> limit = {});

  // Return everything that it has printed so far (after Wait: everything).
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
  // Reads from either pipe. Returns false at the end of both, or at the deadline.
  bool ReadSome(std::chrono::steady_clock::time_point deadline);

  const ChildOptions options_;
  pid_t pid_ = -1;
  int pidfd_ = -1;
  Pipe output_, errors_;
  std::optional<int> code_;
  size_t read_ = 0;  // of output, by ReadLine
};

// A temporary folder, removed with its contents on destruction.
class TemporaryFolder {
 public:
  // Makes "NAME-XXXXXX" in the system's temporary folder.
  static absl::StatusOr<TemporaryFolder> Make(const std::string& name);
  ~TemporaryFolder();
  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&&) = delete;

  const std::string& path() const { return path_; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;  // empty: moved from
};

// Returns the environment for a program that must see only `folder` and nothing of the machine's
// own configuration.
std::map<std::string, std::string> CleanEnvironment(const std::string& folder);

}  // namespace voxeld::child
