// Cuts connections that cost more than a client may before it is trusted. gRPC parses headers, at any
// length and price, before anybody can refuse them; what it is fed is what can be bounded.
//
//   authorised    a call of the connection sent its first message, or got a whole request that could
//                 be parsed: from then on bytes and time are not limited any more. Until then:
//   bytes         more than unauthorised_bytes came: cut. Looked at whenever some come, at each
//                 Look, and once more when the connection would be authorised, so that a first
//                 request beyond the limit never passes, however fast it was
//   time          unauthorised_limit_ns went by: cut. It stands still while a call waits for the
//                 daemon's answer, as a core that is busy is no fault of the client's
//   cancelling    after that too: more calls than max_cancelled_calls_per_second ended without an
//                 answer within a second: cut
//
// Unix sockets, whose users the kernel names, are free of bytes and time. Times are the clock's.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "daemon/listen/counters.h"
#include "daemon/listen/limits.h"
#include "daemon/listen/log_gate.h"
#include "daemon/listen/peer.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::listen {

// A connection's socket, as the guard needs it. Called with the guard's lock held.
class Wire {
 public:
  virtual ~Wire() = default;
  virtual uint64_t BytesReceived() = 0;
  virtual void Cut() = 0;  // at once, in both directions; what was received is thrown away
};

using ConnectionId = uint64_t;

// Thread-safe.
class Guard {
 public:
  // How often unauthorised connections are looked at.
  static constexpr sync::TimeNs kLookInterval = 20 * sync::kMillisecond;

  // All outlive the guard; `log` may be none.
  Guard(const ConnectionLimits& limits, sync::Clock& clock, Counters& counters, Logger* log)
      : limits_(limits), clock_(clock), counters_(counters), gate_(clock, log) {}

  // ---- from the listener

  // Whether another connection of `peer` may be had, counted and logged: ResourceExhausted says
  // which limit it would go beyond.
  absl::Status MayEnter(const Peer& peer);
  // From accept on. `own`: the daemon's own, which counts against no limit but those of bytes and
  // time.
  ConnectionId Enter(const Peer& peer, bool own, std::unique_ptr<Wire> wire);
  // It has been closed. The wire goes.
  void Leave(ConnectionId id);
  // Bytes came. Answers whether that is still of interest.
  bool OnBytes(ConnectionId id);
  // Looks at all unauthorised connections. When to look again; kNever if there are none.
  sync::TimeNs Look();

  // ---- from the services: `peer` as PeerName gives it

  // A call got its first message, and will answer it or end.
  void OnMessage(const std::string& peer);
  void OnAuthorised(const std::string& peer);
  // Of a call for which OnMessage was called.
  void OnCallEnd(const std::string& peer);
  // Authorised connections over TCP that have got some bytes since the last time.
  std::vector<std::string> Busy();
  // How many calls of the connection have ended without an answer since it was accepted.
  void OnCancelled(const std::string& peer, uint64_t in_all);

 private:
  struct Connection {
    ConnectionId id = 0;
    std::string name, address;
    bool own = false, unix_socket = false;
    std::unique_ptr<Wire> wire;
    sync::TimeNs since = 0;  // accepted, or a call ended without authorising it
    uint32_t waiting = 0;    // calls that the daemon has yet to answer
    bool watched = false;    // not authorised yet
    bool cut = false;
    uint64_t bytes = 0;  // when Busy last asked
    // The second in which cancelled calls are counted, and those before it.
    sync::TimeNs cancelled_since = 0;
    uint64_t cancelled_before = 0;
  };

  Connection* Find(const std::string& peer) VOXELD_REQUIRES(mutex_);
  bool BytesAreMany(Connection& connection) VOXELD_REQUIRES(mutex_);
  void Cut(Connection& connection, Counters::Count& counter, const std::string& why)
      VOXELD_REQUIRES(mutex_);

  const ConnectionLimits limits_;
  sync::Clock& clock_;
  Counters& counters_;
  LogGate gate_;
  sync::Mutex mutex_;
  ConnectionId next_ VOXELD_GUARDED_BY(mutex_) = 1;
  std::unordered_map<ConnectionId, Connection> connections_ VOXELD_GUARDED_BY(mutex_);
  std::map<ConnectionId, Connection*> watched_ VOXELD_GUARDED_BY(mutex_);  // oldest first
  std::map<ConnectionId, Connection*> authorised_ VOXELD_GUARDED_BY(mutex_);
  std::unordered_map<std::string, ConnectionId> by_name_ VOXELD_GUARDED_BY(mutex_);
  // Of those that count against limits.
  std::unordered_map<std::string, uint32_t> by_address_ VOXELD_GUARDED_BY(mutex_);
  uint32_t counted_ VOXELD_GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld::daemon::listen
