// A child process with its output, for tests: a child that cannot be started or does not exit is a
// test failure.
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
  // `environment` overrides the test's own.
  Process(const std::vector<std::string>& arguments,
          const std::map<std::string, std::string>& environment = {});

  pid_t pid() const { return child_->pid(); }
  void Signal(int signal) { child_->Signal(signal); }

  // Returns the next line of its standard output or error, without the newline; nullopt at the end,
  // or after a timeout.
  std::optional<std::string> ReadLine() { return child_->ReadLine(); }
  // Returns the first further line that contains `text`.
  std::optional<std::string> ReadLineWith(const std::string& text) {
    return child_->ReadLineWith(text);
  }

  // Waits for its exit. Returns the exit code, or −signal; nullopt if it did not exit within
  // `limit`.
  std::optional<int> Wait(std::chrono::milliseconds limit = kPatience) {
    return child_->Wait(limit);
  }

  // Returns its output so far (after Wait: all of it).
  const std::string& output() const { return child_->output(); }

 private:
  std::unique_ptr<child::ChildProcess> child_;
};

struct Ended {
  int code = -1;
  std::string output;
};

// Runs a program until it exits.
Ended RunToEnd(const std::vector<std::string>& arguments,
               const std::map<std::string, std::string>& environment = {});

}  // namespace voxeld::e2e
