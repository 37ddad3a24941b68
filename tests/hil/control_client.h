// The other end of an emulator's control socket (tools/emulator/emulated.h says what it understands).
#pragma once

#include <string>

namespace voxeld::hil {

class ControlClient {
 public:
  // Throws std::runtime_error if nobody listens.
  explicit ControlClient(const std::string& path);
  ~ControlClient();
  ControlClient(const ControlClient&) = delete;
  ControlClient& operator=(const ControlClient&) = delete;

  // Sends a line and waits for the answer. Throws for an error.
  std::string Ask(const std::string& line);

 private:
  const int fd_;
};

}  // namespace voxeld::hil
