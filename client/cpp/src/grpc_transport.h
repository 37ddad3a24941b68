// The transport over gRPC.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "client/cpp/src/transport.h"

namespace voxeld::client {

// How gRPC notices that nobody is at the other end any more: after `interval` without anything from there it asks,
// and when there is no answer within `timeout` the stream ends (Unavailable). The session's own pings cannot do
// that while a message is being written or no credit is left.
struct Keepalive {
  std::chrono::milliseconds interval{20'000};  // not less than the server allows: 5 s by default
  std::chrono::milliseconds timeout{10'000};
};

// `target` as gRPC writes it (voxeld/address.h).
std::unique_ptr<Transport> MakeGrpcTransport(std::string target, Keepalive keepalive = {});

}  // namespace voxeld::client
