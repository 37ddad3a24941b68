#include "tools/emulator/control_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::emulator {
namespace {

constexpr size_t kMostLine = 4096;

// Returns whether the socket was left behind by a process that has exited.
bool Stale(const sockaddr_un& address) {
  struct stat file {};
  if (lstat(address.sun_path, &file) != 0 || !S_ISSOCK(file.st_mode)) return false;
  const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (probe < 0) return false;
  const bool refused =
      connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 &&
      errno == ECONNREFUSED;
  close(probe);
  return refused;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ControlSocket>> ControlSocket::Listen(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("the path of the control socket has ",
                                                   path.size(), " bytes; it must have less than ",
                                                   sizeof(address.sun_path)));
  }
  std::memcpy(address.sun_path, path.data(), path.size());
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto bound = [&] {
    return bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)) == 0;
  };
  if (fd < 0 ||
      (!bound() &&
       !(errno == EADDRINUSE && Stale(address) && unlink(path.c_str()) == 0 && bound())) ||
      listen(fd, 8) != 0) {
    const int error = errno;
    if (fd >= 0) close(fd);
    const std::string what =
        absl::StrCat("the control socket ", path, ": ", std::generic_category().message(error));
    return error == EADDRINUSE ? absl::AlreadyExistsError(what) : absl::UnavailableError(what);
  }
  return std::unique_ptr<ControlSocket>(new ControlSocket(fd, path));
}

ControlSocket::~ControlSocket() {
  for (const Peer& peer : peers_) close(peer.fd);
  close(fd_);
  unlink(path_.c_str());
}

void ControlSocket::AddTo(std::vector<pollfd>& fds) const {
  fds.push_back({fd_, POLLIN, 0});
  for (const Peer& peer : peers_) fds.push_back({peer.fd, POLLIN, 0});
}

void ControlSocket::Serve(absl::FunctionRef<std::string(std::string_view line)> answer) {
  for (int fd = 0; (fd = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK)) >= 0;) {
    peers_.push_back({fd, ""});
  }
  std::erase_if(peers_, [&](Peer& peer) {
    if (ServeOne(peer, answer)) return false;
    close(peer.fd);
    return true;
  });
}

bool ControlSocket::ServeOne(Peer& peer,
                             absl::FunctionRef<std::string(std::string_view line)> answer) {
  char bytes[512];
  while (true) {
    const ssize_t n = recv(peer.fd, bytes, sizeof(bytes), 0);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN) return true;
    if (n <= 0) return false;
    peer.line.append(bytes, static_cast<size_t>(n));
    for (size_t end = 0; (end = peer.line.find('\n')) != std::string::npos;) {
      const std::string reply = answer(std::string_view(peer.line).substr(0, end)) + "\n";
      peer.line.erase(0, end + 1);
      // An answer is far smaller than a socket's buffer, so a peer that does not read it is
      // disconnected.
      if (send(peer.fd, reply.data(), reply.size(), MSG_NOSIGNAL) !=
          static_cast<ssize_t>(reply.size())) {
        return false;
      }
    }
    if (peer.line.size() > kMostLine) return false;
  }
}

}  // namespace voxeld::emulator
