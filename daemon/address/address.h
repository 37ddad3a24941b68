// A server's listen address: HOST:PORT, tls:HOST:PORT or unix:PATH, in the same syntax everywhere.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::daemon {

struct Address {
  bool unix_socket = false;
  bool tls = false;   // never for a unix socket
  std::string host;   // name or number; an IPv6 number without brackets
  uint16_t port = 0;  // 0: any free port
  std::string path;   // of unix_socket: absolute, begins with one slash

  std::string ToString() const;  // the parsed form; a path begins with one slash
  // Returns: whether only this machine can connect: a unix socket, "localhost" or a loopback
  // number.
  bool is_local() const;
  bool operator==(const Address&) const = default;
};

// Errors: InvalidArgument with the remedy.
absl::StatusOr<Address> ParseAddress(std::string_view text);

// Prepares the path of a unix socket for listening: creates its folder (mode 0700 if it is new) and
// removes a socket that no server listens on. Never removes anything that is not a socket. Errors:
// AlreadyExists if a server listens there, otherwise the system's errors. The result may be
// outdated at once. Does nothing for TCP.
absl::Status PrepareToListen(const Address& address);

}  // namespace voxeld::daemon
