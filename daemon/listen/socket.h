// Sockets of the system: those that listen, and what can be asked of a connection.
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

// A socket that listens, non-blocking. Removes the file of a unix socket when it goes, if it still is
// the one that was made.
class ListeningSocket {
 public:
  // One for each number that the address' host has (one is enough; all have the same port), or the
  // one unix socket, mode 0660 from before anybody can connect. AlreadyExists if somebody listens
  // there. `type`: a unix socket's, SOCK_STREAM or SOCK_SEQPACKET.
  static absl::StatusOr<std::vector<ListeningSocket>> Listen(const Address& address,
                                                             int type = SOCK_STREAM);

  // One that was open when the process began and listens for streams; whoever made it keeps it, and a unix
  // socket's file. `tls`: what its connections speak. InvalidArgument if it is something else.
  static absl::StatusOr<ListeningSocket> Adopt(Descriptor descriptor, bool tls);

  ListeningSocket(ListeningSocket&&) = default;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ~ListeningSocket();

  int descriptor() const { return descriptor_.get(); }
  const SocketName& name() const { return name_; }  // with the port that was chosen
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

// A connection's socket under a descriptor of its own: whoever serves the connection may close
// theirs at any time.
//
// Over TCP its receive buffer is small until it is trusted: what a stranger sends waits in its own
// system. Sizes are as SO_RCVBUF has them; the system doubles them.
class SocketWire : public Wire {
 public:
  // While nobody reads: a listening socket hands it to its connections.
  static constexpr int kUnreadBytes = 32 << 10;
  // When somebody does: less than half of the window that was offered first, so that a sender's system
  // waits for the next one, 200 ms, before it sends a little.
  static constexpr int kReadBytes = 6 << 10;
  // What Linux begins with, and adjusts.
  static constexpr int kTrustedBytes = 64 << 10;

  SocketWire(Descriptor descriptor, bool tcp);
  // From now on somebody reads what comes on `descriptor`, a connection over TCP.
  static void Narrow(int descriptor);
  int descriptor() const { return descriptor_.get(); }
  uint64_t BytesReceived() override;
  void Cut() override;
  void Trust() override;

 private:
  const Descriptor descriptor_;
  const bool tcp_;
};

// Who made the connected unix socket, by the kernel's word.
struct PeerCredentials {
  uid_t user = 0;
  pid_t process = 0;
};
absl::StatusOr<PeerCredentials> CredentialsOf(int descriptor);

}  // namespace voxeld::daemon::listen
