// Hands connections to gRPC. Each kind has its own acceptor, so that a call's handler can find out
// the kind of its connection.
//
//   TCP           unchanged
//   TLS           with a verified client certificate; uses the store's current files
//   unix socket   one acceptor per user, according to the kernel (SO_PEERCRED), because gRPC has no
//                 names for such connections
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
  // Maximum number of different users of unix sockets while the daemon runs; connections of further
  // users are closed.
  static constexpr size_t kMostUsers = 64;

  // `tls` null: no address uses TLS. Otherwise it must outlive the server.
  explicit Acceptors(const access::TlsStore* tls);
  ~Acceptors();
  Acceptors(const Acceptors&) = delete;
  Acceptors& operator=(const Acceptors&) = delete;

  void AddTo(grpc::ServerBuilder& builder);

  // Takes a connection. Call on the listener's thread after the server has started. Returns: false
  // if there are too many users; the connection is then closed.
  bool Take(const listen::Accepted& accepted, Descriptor connection);

 private:
  class Impl;
  const std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::services
