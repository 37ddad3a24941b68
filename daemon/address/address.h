// Where a server listens: HOST:PORT, tls:HOST:PORT or unix:PATH, the same everywhere.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::daemon {

struct Address {
  bool unix_socket = false;
  bool tls = false;   // not of a unix socket
  std::string host;   // name or number; an IPv6 number without its brackets
  uint16_t port = 0;  // 0: any that is free
  std::string path;   // unix_socket: absolute, begins with one slash

  std::string ToString() const;  // as it was written, a path with one slash before it
  // Whether only this machine can connect to it: a unix socket, "localhost", a loopback number.
  bool is_local() const;
  bool operator==(const Address&) const = default;
};

// InvalidArgument says what would be right.
absl::StatusOr<Address> ParseAddress(std::string_view text);

// Makes room for a unix socket that is to be listened on: makes its folder (mode 0700 if it is new)
// and removes a socket that nobody listens on any more; never anything that is not a socket.
// AlreadyExists if somebody listens there; other errors as the system has them. What it finds may
// change afterwards. TCP needs none of this.
absl::Status PrepareToListen(const Address& address);

}  // namespace voxeld::daemon
