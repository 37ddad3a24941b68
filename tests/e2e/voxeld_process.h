// The real voxeld, started by a test in a folder of its own.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/e2e/process.h"

namespace voxeld::e2e {

// A folder that is removed with all its contents.
class Folder {
 public:
  Folder();
  ~Folder();
  const std::string& path() const { return path_; }
  std::string File(const std::string& name, const std::string& text) const;

 private:
  std::string path_;
};

// Returns an environment in which the machine's own configuration is not found.
std::map<std::string, std::string> CleanEnvironment(const Folder& folder);

// Returns the path of the program.
std::string VoxeldBinary();
// Returns the program with these arguments.
std::vector<std::string> Voxeld(std::vector<std::string> arguments);

// A running daemon that listens on a Unix socket, and on a port and an http port chosen by the
// system, with a small, quick display named "sim".
class Daemon {
 public:
  explicit Daemon(const std::vector<std::string>& more = {});

  Process& process() { return *process_; }
  pid_t process_id() const { return process_->pid(); }
  const Folder& folder() const { return folder_; }
  const std::string& unix_target() const { return unix_target_; }
  const std::string& tcp_target() const { return tcp_target_; }
  const std::string& http() const { return http_; }  // HOST:PORT

 private:
  Folder folder_;
  std::string unix_target_, tcp_target_, http_;
  std::unique_ptr<Process> process_;
};

}  // namespace voxeld::e2e
