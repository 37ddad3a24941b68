// How connections come to gRPC: each kind by an acceptor of its own, so that a call can be asked what
// its connection was.
//
//   TCP           as it is
//   TLS           with a client certificate that is verified; by what the store has at the time
//   unix socket   an acceptor for each user, by the kernel's word (SO_PEERCRED); gRPC has no name for
//                 the connections themselves
#pragma once

#include <memory>

#include "daemon/access/tls_store.h"
#include "daemon/address/descriptor.h"
#include "daemon/listen/listener.h"

namespace grpc {
class ServerBuilder;
}

namespace voxeld::daemon::services {

class Acceptors {
 public:
  // Different users of unix sockets as long as the daemon runs; the connections of further ones are
  // closed.
  static constexpr size_t kMostUsers = 64;

  // `tls`: none: nobody listens for TLS. Outlives the server.
  explicit Acceptors(const access::TlsStore* tls);
  ~Acceptors();
  Acceptors(const Acceptors&) = delete;
  Acceptors& operator=(const Acceptors&) = delete;

  void AddTo(grpc::ServerBuilder& builder);

  // Hands over. On the listener's thread, after the server has started. False, and it is closed: there
  // are too many users.
  bool Take(const listen::Accepted& accepted, Descriptor connection);

 private:
  class Impl;
  const std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::services
