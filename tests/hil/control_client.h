// A client of an emulator's control socket (tools/emulator/emulated.h describes its commands).
#pragma once

#include <string>

namespace voxeld::hil {

class ControlClient {
 public:
  // Throws std::runtime_error if no process listens.
  explicit ControlClient(const std::string& path);
  ~ControlClient();
  ControlClient(const ControlClient&) = delete;
  ControlClient& operator=(const ControlClient&) = delete;

  // Sends a line and waits for the answer. Throws if the answer is an error.
  std::string Ask(const std::string& line);

 private:
  const int fd_;
};

}  // namespace voxeld::hil
