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
  // The greatest message, and what a call may have on the way besides: of an authorised connection,
  // bytes beyond one of the former and as many of the latter as it has calls, of which neither a call
  // nor a message came.
  uint64_t max_message_bytes = 16u << 20;
  uint64_t lookahead_bytes = 256u << 10;
  // How long the address of a connection that was cut is refused; twice as long each time that it
  // comes back and is cut again, up to Guard::kLongestPenalty times as long. 0: not at all.
  int64_t cut_penalty_ns = 1 * sync::kSecond;
  // Calls of one connection that end without an answer, in a second; 0: any number.
  uint32_t max_cancelled_calls_per_second = 100;

  // The listener connects to itself this often; 0: never.
  int64_t probe_interval_ns = 5 * sync::kSecond;
};

}  // namespace voxeld::daemon::listen
