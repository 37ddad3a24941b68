// Wraps listening sockets and the properties of a connection's socket.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/address/address.h"
#include "daemon/address/descriptor.h"
#include "daemon/listen/guard.h"
#include "daemon/listen/peer.h"

namespace voxeld::daemon::listen {

struct SocketName {
  sockaddr_storage address = {};
  socklen_t length = sizeof(sockaddr_storage);
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&address); }
  sockaddr* get() { return reinterpret_cast<sockaddr*>(&address); }
};

// A non-blocking listening socket. Its destructor removes the file of a unix socket if that is
// still the one that was created.
class ListeningSocket {
 public:
  // Returns: one socket per address of the host (one success is enough; all have the same port), or
  // one unix socket, which has mode 0660 before clients can connect. `type`: of a unix socket,
  // SOCK_STREAM or SOCK_SEQPACKET. Errors: AlreadyExists if another server listens there.
  static absl::StatusOr<std::vector<ListeningSocket>> Listen(const Address& address,
                                                             int type = SOCK_STREAM);

  // Adopts an inherited listening stream socket. The creator keeps the socket, and the file of a
  // unix socket. `tls`: whether its connections use TLS. Errors: InvalidArgument if it is anything
  // else.
  static absl::StatusOr<ListeningSocket> Adopt(Descriptor descriptor, bool tls);

  ListeningSocket(ListeningSocket&&) = default;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ~ListeningSocket();

  int descriptor() const { return descriptor_.get(); }
  const SocketName& name() const { return name_; }  // with the chosen port
  const Address& address() const { return address_; }

 private:
  ListeningSocket() = default;
  static absl::StatusOr<std::vector<ListeningSocket>> ListenUnix(const Address& address, int type);
  static absl::StatusOr<std::vector<ListeningSocket>> ListenTcp(const Address& address);

  Descriptor descriptor_;
  SocketName name_;
  Address address_;
  dev_t device_ = 0;
  ino_t inode_ = 0;
};

// A second descriptor of a connection's socket, so that the server may close its own at any time.
//
// Over TCP the receive buffer is small until the connection is trusted, so that a stranger's data
// waits in the stranger's system. Sizes are values of SO_RCVBUF; the system doubles them.
class SocketWire : public Wire {
 public:
  // Buffer before a server reads: connections inherit it from the listening socket.
  static constexpr int kUnreadBytes = 32 << 10;
  // Buffer once a server reads: less than half of the first window, so that the sender's system
  // waits 200 ms for the next window before it sends small segments.
  static constexpr int kReadBytes = 6 << 10;
  // Linux's initial value, which it adjusts.
  static constexpr int kTrustedBytes = 64 << 10;

  SocketWire(Descriptor descriptor, bool tcp);
  // Sets kReadBytes on `descriptor`, a TCP connection that a server is about to read.
  static void Narrow(int descriptor);
  int descriptor() const { return descriptor_.get(); }
  uint64_t BytesReceived() override;
  void Cut() override;
  void Trust() override;

 private:
  const Descriptor descriptor_;
  const bool tcp_;
};

// The user and process of a connected unix socket's peer, according to the kernel.
struct PeerCredentials {
  uid_t user = 0;
  pid_t process = 0;
};
absl::StatusOr<PeerCredentials> CredentialsOf(int descriptor);

}  // namespace voxeld::daemon::listen
