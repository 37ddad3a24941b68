#include "daemon/listen/socket.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/tcp.h>  // tcp_info with bytes_received, which glibc's header lacks
#include <netdb.h>
#include <netinet/in.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::listen {
namespace {

constexpr mode_t kSocketMode = 0660;
constexpr size_t kDiscardBytes = 1u << 20;
constexpr int kBufferLock = 72;       // SO_BUF_LOCK, which glibc's headers lack
constexpr int kFixedBytes = 4 << 20;  // for a buffer that the system cannot adjust

absl::Status Failed(int error, const Address& address) {
  if (error == EADDRINUSE) {
    return absl::AlreadyExistsError(
        absl::StrCat("somebody listens on ", address.ToString(),
                     " already; end that, or give another address with --listen"));
  }
  return absl::ErrnoToStatus(error, absl::StrCat(address.ToString(), " cannot be listened on"));
}

void Set(int descriptor, int level, int option, int value) {
  setsockopt(descriptor, level, option, &value, sizeof(value));
}

// Lets the system adjust the receive buffer again. Requires Linux 5.14.
bool LetBufferGo(int descriptor) {
  const int none = 0;
  return setsockopt(descriptor, SOL_SOCKET, kBufferLock, &none, sizeof(none)) == 0;
}

void SetPort(SocketName& name, uint16_t port) {
  if (name.address.ss_family == AF_INET) {
    reinterpret_cast<sockaddr_in*>(&name.address)->sin_port = htons(port);
  } else {
    reinterpret_cast<sockaddr_in6*>(&name.address)->sin6_port = htons(port);
  }
}

uint16_t PortOf(const SocketName& name) {
  return ntohs(name.address.ss_family == AF_INET
                   ? reinterpret_cast<const sockaddr_in*>(&name.address)->sin_port
                   : reinterpret_cast<const sockaddr_in6*>(&name.address)->sin6_port);
}

}  // namespace

absl::StatusOr<std::vector<ListeningSocket>> ListeningSocket::Listen(const Address& address,
                                                                     int type) {
  if (absl::Status ready = PrepareToListen(address); !ready.ok()) return ready;
  return address.unix_socket ? ListenUnix(address, type) : ListenTcp(address);
}

absl::StatusOr<ListeningSocket> ListeningSocket::Adopt(Descriptor descriptor, bool tls) {
  const auto option = [&](int name) {
    int value = -1;
    socklen_t length = sizeof(value);
    return getsockopt(descriptor.get(), SOL_SOCKET, name, &value, &length) == 0 ? value : -1;
  };
  ListeningSocket made;
  if (option(SO_ACCEPTCONN) != 1 || option(SO_TYPE) != SOCK_STREAM ||
      getsockname(descriptor.get(), made.name_.get(), &made.name_.length) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("the descriptor ", descriptor.get(),
                     " that the daemon was given is no socket that listens for streams"));
  }
  char host[INET6_ADDRSTRLEN] = {};
  switch (made.name_.address.ss_family) {
    case AF_UNIX: {
      const auto* name = reinterpret_cast<const sockaddr_un*>(&made.name_.address);
      if (tls || name->sun_path[0] != '/') {
        return absl::InvalidArgumentError(
            "a unix socket that the daemon was given has no path, or is to speak TLS");
      }
      made.address_.unix_socket = true;
      made.address_.path = name->sun_path;
      break;
    }
    case AF_INET:
      inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(&made.name_.address)->sin_addr, host,
                sizeof(host));
      break;
    case AF_INET6:
      inet_ntop(AF_INET6, &reinterpret_cast<const sockaddr_in6*>(&made.name_.address)->sin6_addr,
                host, sizeof(host));
      break;
    default:
      return absl::InvalidArgumentError(
          "a socket that the daemon was given is neither TCP nor a unix socket");
  }
  if (!made.address_.unix_socket) {
    made.address_.host = host;
    made.address_.port = PortOf(made.name_);
    made.address_.tls = tls;
    if (LetBufferGo(descriptor.get())) {
      Set(descriptor.get(), SOL_SOCKET, SO_RCVBUF, SocketWire::kUnreadBytes);
      LetBufferGo(descriptor.get());
    }
  }
  fcntl(descriptor.get(), F_SETFL, fcntl(descriptor.get(), F_GETFL) | O_NONBLOCK);
  made.descriptor_ = std::move(descriptor);
  return made;
}

absl::StatusOr<std::vector<ListeningSocket>> ListeningSocket::ListenUnix(const Address& address,
                                                                         int type) {
  ListeningSocket made;
  made.descriptor_.Reset(socket(AF_UNIX, type | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!made.descriptor_.ok()) return Failed(errno, address);
  auto* name = reinterpret_cast<sockaddr_un*>(&made.name_.address);
  name->sun_family = AF_UNIX;
  std::memcpy(name->sun_path, address.path.data(), address.path.size());
  made.name_.length = sizeof(sockaddr_un);
  if (bind(made.descriptor(), made.name_.get(), made.name_.length) != 0) {
    return Failed(errno, address);
  }
  struct stat found;
  if (stat(address.path.c_str(), &found) == 0) {
    made.device_ = found.st_dev;
    made.inode_ = found.st_ino;
  }
  made.address_ = address;
  // Clients cannot connect before listen().
  if (chmod(address.path.c_str(), kSocketMode) != 0 ||
      ::listen(made.descriptor(), SOMAXCONN) != 0) {
    return Failed(errno, address);
  }
  std::vector<ListeningSocket> out;
  out.push_back(std::move(made));
  return out;
}

absl::StatusOr<std::vector<ListeningSocket>> ListeningSocket::ListenTcp(const Address& address) {
  addrinfo hints = {};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int code =
      getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found);
  if (code != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("the host of ", address.ToString(), " is not known: ", gai_strerror(code)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> list(found, freeaddrinfo);
  std::vector<ListeningSocket> out;
  uint16_t port = address.port;
  int first_error = 0;
  for (const addrinfo* at = found; at != nullptr; at = at->ai_next) {
    ListeningSocket made;
    made.descriptor_.Reset(
        socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, at->ai_protocol));
    if (!made.descriptor_.ok()) continue;  // for example, without IPv6
    const int descriptor = made.descriptor();
    Set(descriptor, SOL_SOCKET, SO_REUSEADDR, 1);
    // Connections inherit this buffer size. If the size stayed locked, they could never get a large
    // window.
    if (LetBufferGo(descriptor)) {
      Set(descriptor, SOL_SOCKET, SO_RCVBUF, SocketWire::kUnreadBytes);
      LetBufferGo(descriptor);
    }
    if (at->ai_family == AF_INET6) {
      // [::] means every address of this machine, including IPv4.
      Set(descriptor, IPPROTO_IPV6, IPV6_V6ONLY,
          IN6_IS_ADDR_UNSPECIFIED(&reinterpret_cast<sockaddr_in6*>(at->ai_addr)->sin6_addr) ? 0
                                                                                            : 1);
    }
    std::memcpy(&made.name_.address, at->ai_addr, at->ai_addrlen);
    made.name_.length = at->ai_addrlen;
    SetPort(made.name_, port);
    if (bind(descriptor, made.name_.get(), made.name_.length) != 0 ||
        ::listen(descriptor, SOMAXCONN) != 0) {
      if (first_error == 0 || errno == EADDRINUSE) first_error = errno;
      if (errno == EADDRINUSE) return Failed(errno, address);
      continue;
    }
    made.name_.length = sizeof(made.name_.address);
    getsockname(descriptor, made.name_.get(), &made.name_.length);
    port = PortOf(made.name_);
    made.address_ = address;
    made.address_.port = port;
    out.push_back(std::move(made));
  }
  if (out.empty()) return Failed(first_error == 0 ? EADDRNOTAVAIL : first_error, address);
  return out;
}

ListeningSocket::~ListeningSocket() {
  struct stat found;
  if (inode_ == 0 || !descriptor_.ok() || stat(address_.path.c_str(), &found) != 0) return;
  if (found.st_dev == device_ && found.st_ino == inode_) unlink(address_.path.c_str());
}

SocketWire::SocketWire(Descriptor descriptor, bool tcp)
    : descriptor_(std::move(descriptor)), tcp_(tcp) {
  if (tcp_) Set(descriptor_.get(), SOL_SOCKET, SO_RCVBUF, kUnreadBytes);
}

void SocketWire::Narrow(int descriptor) { Set(descriptor, SOL_SOCKET, SO_RCVBUF, kReadBytes); }

void SocketWire::Trust() {
  if (!tcp_) return;
  const int descriptor = descriptor_.get();
  Set(descriptor, SOL_SOCKET, SO_RCVBUF, kTrustedBytes);
  // The system does not adjust a size that was set explicitly unless it is unlocked.
  if (!LetBufferGo(descriptor)) Set(descriptor, SOL_SOCKET, SO_RCVBUF, kFixedBytes);
  Set(descriptor, IPPROTO_TCP, TCP_WINDOW_CLAMP, std::numeric_limits<int>::max() / 2);
}

uint64_t SocketWire::BytesReceived() {
  tcp_info info = {};
  socklen_t length = sizeof(info);
  // A unix socket has no such count.
  if (getsockopt(descriptor_.get(), IPPROTO_TCP, TCP_INFO, &info, &length) != 0) return 0;
  return info.tcpi_bytes_received;
}

void SocketWire::Cut() {
  // Resets the connection at once, even if other descriptors refer to it, and discards received
  // data.
  const sockaddr nobody = {.sa_family = AF_UNSPEC, .sa_data = {}};
  if (connect(descriptor_.get(), &nobody, sizeof(nobody)) == 0) return;
  // The last descriptor to close resets the connection, without waiting for a client that still
  // sends.
  const linger reset = {.l_onoff = 1, .l_linger = 0};
  setsockopt(descriptor_.get(), SOL_SOCKET, SO_LINGER, &reset, sizeof(reset));
  shutdown(descriptor_.get(), SHUT_RDWR);
  // Otherwise the server would still read and parse the remaining data.
  while (recv(descriptor_.get(), nullptr, kDiscardBytes, MSG_TRUNC | MSG_DONTWAIT) > 0) {
  }
}

absl::StatusOr<PeerCredentials> CredentialsOf(int descriptor) {
  ucred found = {};
  socklen_t length = sizeof(found);
  if (getsockopt(descriptor, SOL_SOCKET, SO_PEERCRED, &found, &length) != 0) {
    return absl::ErrnoToStatus(errno, "who is at the other end of a unix socket is not known");
  }
  return PeerCredentials{.user = found.uid, .process = found.pid};
}

}  // namespace voxeld::daemon::listen
