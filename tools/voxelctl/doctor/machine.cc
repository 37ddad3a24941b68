#include "tools/voxelctl/doctor/machine.h"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>

#include "absl/strings/match.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kAnswerMs = 500;

// libcuda's own names and types, of which three functions are needed.
using Init = int (*)(unsigned);
using Count = int (*)(int*);
using Name = int (*)(char*, int, int);

CudaState LookAtCuda() {
  CudaState state;
  void* const library = dlopen("libcuda.so.1", RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) return state;
  state.installed = true;
  const auto init = reinterpret_cast<Init>(dlsym(library, "cuInit"));
  const auto count = reinterpret_cast<Count>(dlsym(library, "cuDeviceGetCount"));
  const auto name = reinterpret_cast<Name>(dlsym(library, "cuDeviceGetName"));
  constexpr int kNotFound = 500;  // CUDA_ERROR_NOT_FOUND
  int devices = 0;
  state.error = init == nullptr || count == nullptr || name == nullptr ? kNotFound : init(0);
  if (state.error == 0) state.error = count(&devices);
  for (int i = 0; state.error == 0 && i < devices; ++i) {
    std::array<char, 256> text{};
    state.error = name(text.data(), static_cast<int>(text.size()) - 1, i);
    state.devices.emplace_back(text.data());
  }
  // The library is not closed, because what it started keeps running.
  return state;
}

class Socket {
 public:
  explicit Socket(uint16_t port) : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address_.sin_port = htons(port);
  }
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  bool Bind() const {
    const int on = 1;
    setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    return bind(fd_, reinterpret_cast<const sockaddr*>(&address_), sizeof(address_)) == 0 ||
           errno != EADDRINUSE;
  }
  // Returns the beginning of the response to `request`; empty if that takes too long.
  std::string Ask(const std::string& request) const {
    if (connect(fd_, reinterpret_cast<const sockaddr*>(&address_), sizeof(address_)) != 0)
      return "";
    if (send(fd_, request.data(), request.size(), MSG_NOSIGNAL) < 0) return "";
    std::string answer;
    pollfd waits{fd_, POLLIN, 0};
    while (answer.size() < 65536 && poll(&waits, 1, kAnswerMs) == 1) {
      std::array<char, 4096> part{};
      const ssize_t got = recv(fd_, part.data(), part.size(), 0);
      if (got <= 0) break;
      answer.append(part.data(), static_cast<size_t>(got));
    }
    return answer;
  }

 private:
  int fd_;
  sockaddr_in address_{};
};

PortState LookAtPort(uint16_t port) {
  if (Socket(port).Bind()) return PortState::kFree;
  // The clients' port speaks HTTP/2, sends its settings first (RFC 9113 §3.4), and closes
  // connections that begin differently.
  using namespace std::string_literals;
  const std::string settings =
      Socket(port).Ask("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\4\0\0\0\0\0"s);
  if (settings.size() >= 9 && settings[3] == 4 && settings[0] == 0) return PortState::kClients;
  // The http port reports its health.
  const std::string health =
      Socket(port).Ask("GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n");
  return absl::StrContains(health, "\"reasons\"") ? PortState::kHttp : PortState::kOther;
}

}  // namespace

Machine ThisMachine() {
  Machine machine;
  machine.writable = [](const std::string& path) { return access(path.c_str(), R_OK | W_OK) == 0; };
  machine.cuda = &LookAtCuda;
  machine.port = &LookAtPort;
  return machine;
}

}  // namespace voxeld::voxelctl
