// Identifies the other end of a connection.
#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace voxeld::daemon::listen {

struct Peer {
  // Name of one connection: "ipv4:192.0.2.1:40000", "ipv6:[2001:db8::1]:40000"; for a unix socket
  // "unix:" and the client's socket name, which is mostly empty.
  std::string name;
  // Key for limits per address: "192.0.2.1", "2001:db8:0:0::/64", "user 1000". For a unix socket
  // the caller sets it after asking the kernel.
  std::string address;
  bool unix_socket = false;
};

// Returns: the peer. An IPv4-mapped IPv6 address becomes an IPv4 address.
Peer PeerOf(const sockaddr_storage& address, socklen_t length);

// Converts gRPC's percent-encoded name ("ipv6:%5B::1%5D:40000") to the form of PeerOf.
std::string PeerName(std::string_view grpc_peer);

}  // namespace voxeld::daemon::listen
