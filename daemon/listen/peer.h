// Who is at the other end of a connection.
#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace voxeld::daemon::listen {

struct Peer {
  // One connection: "ipv4:192.0.2.1:40000", "ipv6:[2001:db8::1]:40000"; of a unix socket "unix:"
  // and the name that its client gave it, mostly none.
  std::string name;
  // Whom it is counted with: "192.0.2.1", "2001:db8:0:0::/64", "user 1000". For a unix socket set by
  // whoever asked the kernel.
  std::string address;
  bool unix_socket = false;
};

// An IPv4 number that is written as an IPv6 one is an IPv4 number.
Peer PeerOf(const sockaddr_storage& address, socklen_t length);

// A name as gRPC writes it (percent-encoded: "ipv6:%5B::1%5D:40000") as PeerOf does.
std::string PeerName(std::string_view grpc_peer);

}  // namespace voxeld::daemon::listen
