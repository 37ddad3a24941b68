#include "tests/display/emulator/carriers/peer.h"

#include <sys/socket.h>
#include <unistd.h>

#include <charconv>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

namespace voxeld::display::emulator {

Bytes Hex(std::string_view text) {
  Bytes bytes;
  std::istringstream words{std::string(text)};
  for (std::string word; words >> word;) {
    const size_t star = word.find('*');
    const std::string digits = word.substr(0, star);
    unsigned value = 0;
    int times = 1;
    const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
    if (star != std::string::npos) {
      std::from_chars(word.data() + star + 1, word.data() + word.size(), times);
    }
    if (digits.size() != 2 || read.ptr != digits.data() + 2) {
      throw std::invalid_argument(word);
    }
    bytes.insert(bytes.end(), static_cast<size_t>(times), static_cast<std::byte>(value));
  }
  return bytes;
}

Peer::Peer() {
  int sockets[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) != 0) {
    throw std::runtime_error("socketpair");
  }
  fd_ = sockets[0];
  device_ = sockets[1];
}

Peer::~Peer() {
  Close();
  if (device_ >= 0) close(device_);
}

int Peer::TakeDeviceEnd() { return std::exchange(device_, -1); }

size_t Peer::Send(std::span<const std::byte> bytes) {
  size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t n =
        send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n <= 0) break;
    sent += static_cast<size_t>(n);
  }
  return sent;
}

Bytes Peer::Take() {
  Bytes bytes;
  std::byte some[4096];
  for (ssize_t n = 0; (n = recv(fd_, some, sizeof(some), MSG_DONTWAIT)) > 0;) {
    bytes.insert(bytes.end(), some, some + n);
  }
  return bytes;
}

void Peer::Close() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

}  // namespace voxeld::display::emulator
