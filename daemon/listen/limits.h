// Limits on the resources of one unauthorised client, and of all clients together.
#pragma once

#include <cstdint>

#include "display/sync/clock.h"

namespace voxeld::daemon::listen {

struct ConnectionLimits {
  uint32_t max_connections = 4096;
  // Per address: an IPv4 address, the /64 of an IPv6 address, or a user of a unix socket.
  uint32_t max_connections_per_address = 256;

  // Over TCP, until a message of the connection is authorised (guard.h).
  uint64_t unauthorised_bytes = 64u << 10;
  int64_t unauthorised_limit_ns = 5 * sync::kSecond;
  // Limits on the largest message, and on the additional bytes in flight per call. An authorised
  // connection may receive one message plus these bytes for each call without a call beginning or a
  // message being completed.
  uint64_t max_message_bytes = 16u << 20;
  uint64_t lookahead_bytes = 256u << 10;
  // How long the address of a disconnected connection is refused. Doubles each time that it returns
  // and is disconnected again, up to a factor of Guard::kLongestPenalty. 0: never.
  int64_t cut_penalty_ns = 1 * sync::kSecond;
  // Calls of one connection that may end without an answer within a second; 0: unlimited.
  uint32_t max_cancelled_calls_per_second = 100;

  // How often the listener connects to itself; 0: never.
  int64_t probe_interval_ns = 5 * sync::kSecond;
};

}  // namespace voxeld::daemon::listen
