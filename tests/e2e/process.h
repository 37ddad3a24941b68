// A child process with its output, for tests: what cannot be started or does not end is a failure.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tools/child/child_process.h"

namespace voxeld::e2e {

// Generous: a sanitizer build on a busy machine is slow.
inline constexpr std::chrono::seconds kPatience{60};

// Bound to one thread. A child that still runs is killed on destruction.
class Process {
 public:
  // `environment` goes over the test's own.
  Process(const std::vector<std::string>& arguments,
          const std::map<std::string, std::string>& environment = {});

  pid_t pid() const { return child_->pid(); }
  void Signal(int signal) { child_->Signal(signal); }

  // The next line of its standard output or error, without the newline; nothing at the end, or when
  // patience has run out.
  std::optional<std::string> ReadLine() { return child_->ReadLine(); }
  // The first further line that has `text` in it.
  std::optional<std::string> ReadLineWith(const std::string& text) {
    return child_->ReadLineWith(text);
  }

  // Waits for its end. The exit code, or −signal; nothing if it did not end in `limit`.
  std::optional<int> Wait(std::chrono::milliseconds limit = kPatience) {
    return child_->Wait(limit);
  }

  // All that it has said so far (after Wait: all).
  const std::string& output() const { return child_->output(); }

 private:
  std::unique_ptr<child::ChildProcess> child_;
};

struct Ended {
  int code = -1;
  std::string output;
};

// Runs to the end.
Ended RunToEnd(const std::vector<std::string>& arguments,
               const std::map<std::string, std::string>& environment = {});

}  // namespace voxeld::e2e
