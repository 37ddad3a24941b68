// Where the server is.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::client {

inline constexpr std::string_view kDefaultTcpAddress = "127.0.0.1:50551";

// The value of an environment variable, empty if it is not set.
using Environment = std::function<std::string(const char* name)>;

// VOXELD_SERVER, else the unix socket in the run-time directory ($XDG_RUNTIME_DIR/voxeld.sock,
// /run/voxeld/voxeld.sock, /tmp/voxeld-UID/voxeld.sock) if there is one that this user or root owns,
// else kDefaultTcpAddress.
std::string DefaultAddress(const Environment& environment);
// Of this process's environment.
std::string DefaultAddress();

// HOST:PORT, tls:HOST:PORT (without saying so) or unix:PATH as gRPC writes it, for calls of one's own; InvalidArgument with the text and
// what would be right.
absl::StatusOr<std::string> ServerTarget(std::string_view address);

}  // namespace voxeld::client
