// A child process with its output, for tests.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace voxeld::e2e {

// Generous: a sanitizer build on a busy machine is slow.
inline constexpr std::chrono::seconds kPatience{60};

// Bound to one thread. A child that still runs is killed on destruction.
class Process {
 public:
  // `environment` goes over the test's own.
  Process(const std::vector<std::string>& arguments,
          const std::map<std::string, std::string>& environment = {});
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  void Signal(int signal);

  // The next line of its standard output or error, without the newline; nothing at the end, or when
  // patience has run out.
  std::optional<std::string> ReadLine();
  // The first further line that has `text` in it.
  std::optional<std::string> ReadLineWith(const std::string& text);

  // Waits for its end. The exit code, or −signal; nothing if it did not end in `limit`.
  std::optional<int> Wait(std::chrono::milliseconds limit = kPatience);

  // All that it has said so far (after Wait: all).
  const std::string& output() const { return output_; }

 private:
  bool ReadSome(std::chrono::steady_clock::time_point deadline);

  pid_t pid_ = -1;
  int pidfd_ = -1, pipe_ = -1;
  std::optional<int> code_;
  std::string output_;
  size_t read_ = 0;  // of output_, by ReadLine
};

struct Ended {
  int code = -1;
  std::string output;
};

// Runs to the end.
Ended RunToEnd(const std::vector<std::string>& arguments,
               const std::map<std::string, std::string>& environment = {});

}  // namespace voxeld::e2e
