// What one client may cost before it is trusted, and all of them together.
#pragma once

#include <cstdint>

#include "display/sync/clock.h"

namespace voxeld::daemon::listen {

struct ConnectionLimits {
  uint32_t max_connections = 4096;
  // From one address: an IPv4 number, the /64 of an IPv6 number, or a user of a unix socket.
  uint32_t max_connections_per_address = 256;

  // Over TCP, until a message of the connection has been authorised (guard.h).
  uint64_t unauthorised_bytes = 64u << 10;
  int64_t unauthorised_limit_ns = 5 * sync::kSecond;
  // Calls of one connection that end without an answer, in a second; 0: any number.
  uint32_t max_cancelled_calls_per_second = 100;

  // The listener connects to itself this often; 0: never.
  int64_t probe_interval_ns = 5 * sync::kSecond;
};

}  // namespace voxeld::daemon::listen
