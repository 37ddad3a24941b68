// The transport over gRPC.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "client/cpp/src/transport.h"
#include "voxeld/credentials.h"

namespace voxeld::client {

// How gRPC detects a dead connection: after `interval` without incoming data it sends a ping, and
// if no answer comes within `timeout` the stream ends (Unavailable). The session's own pings
// cannot do that while a message is being written or no credit is left.
struct Keepalive {
  std::chrono::milliseconds interval{20'000};  // not less than the server allows, 5 s by default
  std::chrono::milliseconds timeout{10'000};
};

// `address` as users write it (voxeld/address.h). Errors are those of MakeChannel. Each stream has
// a channel of its own, for which the credential files are read again; if that fails, the stream
// uses the previous channel.
absl::StatusOr<std::unique_ptr<Transport>> MakeGrpcTransport(std::string address,
                                                             Credentials credentials = {},
                                                             Keepalive keepalive = {});

}  // namespace voxeld::client
