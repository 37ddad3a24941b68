#include "tests/hil/control_client.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <stdexcept>

namespace voxeld::hil {

ControlClient::ControlClient(const std::string& path)
    : fd_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  if (connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) {
    close(fd_);
    throw std::runtime_error("no emulator at " + path + ": " + std::strerror(errno));
  }
}

ControlClient::~ControlClient() { close(fd_); }

std::string ControlClient::Ask(const std::string& line) {
  const std::string out = line + "\n";
  if (send(fd_, out.data(), out.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(out.size())) {
    throw std::runtime_error("the emulator has gone");
  }
  std::string answer;
  for (char c = 0; recv(fd_, &c, 1, 0) == 1;) {
    if (c == '\n') {
      if (answer.starts_with("error")) throw std::runtime_error(line + ": " + answer);
      return answer;
    }
    answer.push_back(c);
  }
  throw std::runtime_error("the emulator has gone");
}

}  // namespace voxeld::hil
