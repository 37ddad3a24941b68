// Sockets of the system: those that listen, and what can be asked of a connection.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/address/address.h"
#include "daemon/listen/descriptor.h"
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
  // there.
  static absl::StatusOr<std::vector<ListeningSocket>> Listen(const Address& address);

  ListeningSocket(ListeningSocket&&) = default;
  ListeningSocket& operator=(ListeningSocket&&) = delete;
  ~ListeningSocket();

  int descriptor() const { return descriptor_.get(); }
  const SocketName& name() const { return name_; }  // with the port that was chosen
  const Address& address() const { return address_; }

 private:
  ListeningSocket() = default;
  static absl::StatusOr<std::vector<ListeningSocket>> ListenUnix(const Address& address);
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
// Over TCP its receive buffer is small until it is trusted: the first window that the system offers
// holds a first call, and what is behind it comes a little at a time, at the other system's pace.
class SocketWire : public Wire {
 public:
  static constexpr int kNarrowBytes = 12 << 10;  // as SO_RCVBUF has it: the system doubles it

  SocketWire(Descriptor descriptor, bool tcp);
  int descriptor() const { return descriptor_.get(); }
  uint64_t BytesReceived() override;
  void Cut() override;
  void Trust() override;

 private:
  const Descriptor descriptor_;
  int wide_bytes_ = 0;  // what the buffer was; 0: it is as it was
};

// Who made the connected unix socket, by the kernel's word.
struct PeerCredentials {
  uid_t user = 0;
  pid_t process = 0;
};
absl::StatusOr<PeerCredentials> CredentialsOf(int descriptor);

}  // namespace voxeld::daemon::listen
