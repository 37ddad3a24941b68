// The address of the server.
#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace voxeld::client {

inline constexpr std::string_view kDefaultTcpAddress = "127.0.0.1:50551";

// Returns the value of an environment variable, empty if it is not set.
using Environment = std::function<std::string(const char* name)>;

// Returns VOXELD_SERVER if it is set; else the unix socket in the run-time directory
// ($XDG_RUNTIME_DIR/voxeld.sock, /run/voxeld/voxeld.sock, /tmp/voxeld-UID/voxeld.sock) if there is
// one that this user or root owns; else kDefaultTcpAddress.
std::string DefaultAddress(const Environment& environment);
// The same with this process's environment.
std::string DefaultAddress();

// Converts HOST:PORT, tls:HOST:PORT or unix:PATH to gRPC's notation (which does not mention TLS),
// for callers that make their own gRPC calls. Errors: InvalidArgument with the text and what is
// expected.
absl::StatusOr<std::string> ServerTarget(std::string_view address);

}  // namespace voxeld::client
