#include "tests/tools/emulator/emulator_process.h"

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "tests/programs.h"

namespace voxeld::emulator {
namespace {

int Connected(int family, const sockaddr* address, socklen_t size) {
  const int fd = socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd >= 0 && connect(fd, address, size) == 0) return fd;
  if (fd >= 0) close(fd);
  throw std::runtime_error("nobody listens");
}

}  // namespace

TestFolder::TestFolder()
    : path_((std::filesystem::temp_directory_path() / "voxeld-emulator-XXXXXX").string()) {
  if (mkdtemp(path_.data()) == nullptr) throw std::runtime_error("no folder " + path_);
}

TestFolder::~TestFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::vector<std::string> Emulator(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), ProgramBeside("voxeld-emulator"));
  return arguments;
}

int Connect(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  return Connected(AF_UNIX, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
}

int ConnectTcp(uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return Connected(AF_INET, reinterpret_cast<const sockaddr*>(&address), sizeof(address));
}

bool Until(int fd, const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + e2e::kPatience;
  while (!done()) {
    if (std::chrono::steady_clock::now() >= end) return false;
    pollfd ready{fd, POLLIN, 0};
    poll(&ready, 1, 20);
  }
  return true;
}

}  // namespace voxeld::emulator
