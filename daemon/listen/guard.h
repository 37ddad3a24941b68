// Disconnects connections that use more resources than an unauthorised client may. gRPC parses
// headers of any length at any cost before a service can reject them, so the input of gRPC has to
// be limited.
//
//   greeting      The first bytes are not the beginning of a call (greeting.h). gRPC never sees
//                 them.
//   bytes         More than unauthorised_bytes arrived. Checked when bytes arrive, at each Look,
//                 when a call of the connection is answered, and when the connection ends.
//   time          unauthorised_limit_ns has passed. The time stops while a call waits for the
//                 daemon's answer, because a busy core is not the client's fault.
//   authorised    Once a call that authorises (call_watch.h) is answered, bytes and time are no
//                 longer limited. The answer of any other call, such as health, resets both.
//   cancelling    Always checked: more than max_cancelled_calls_per_second calls ended without an
//                 answer within a second.
//   flooding      For authorised connections: more bytes arrived than messages and running calls
//                 can have, and no call began and no message was completed.
//
// Checks take time, so connections are disconnected close to a limit: when a sixteenth of the time
// is left, or when less than three sixteenths of the bytes have been left for kGrace. Until a
// connection is authorised its receive buffer is small (Wire::Trust), so that few bytes can arrive
// between the limit and the disconnect.
//
// After a disconnect (except for time or for room) the address is refused for cut_penalty_ns, and
// twice as long each time that it returns and is disconnected again.
//
// When max_connections or max_connections_per_address are open, the unauthorised connection that
// has been idle longest is disconnected, so that silent strangers cannot exclude others. Each
// connection has kFirstCall to make its first call; meanwhile twice as many may be open. A further
// connection is refused only if all are authorised or active.
//
// Unix sockets, whose users the kernel identifies, are exempt from all this except the limits on
// connections: gRPC has no names for them by which their calls could be distinguished. Times are
// those of the clock.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
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

// A connection's socket, as used by the guard. Thread-safe.
class Wire {
 public:
  virtual ~Wire() = default;
  virtual uint64_t BytesReceived() = 0;
  virtual void Cut() = 0;    // immediately, in both directions; discards received data
  virtual void Trust() = 0;  // sets the normal receive buffer
  // Enables one report: Guard::OnBytes when bytes arrive, or Leave when the connection has ended;
  // the next one requires another Arm. Before the first Arm, bytes are always reported.
  virtual void Arm() = 0;
};

using ConnectionId = uint64_t;

// gRPC's counts of a connection's calls since it was accepted.
struct CallFigures {
  uint64_t cancelled = 0;  // ended without an answer
  uint64_t progress = 0;   // calls begun and messages completed; an increase is progress
  uint64_t open = 0;       // running calls
};

// Thread-safe.
class Guard {
 public:
  // How often unauthorised connections are checked.
  static constexpr sync::TimeNs kLookInterval = 20 * sync::kMillisecond;
  // Shorter than the time (200 ms) after which a system retries a closed window. A client that
  // keeps sending before it is answered waits in its own system, and is not disconnected if the
  // answer arrives in time.
  static constexpr sync::TimeNs kGrace = 100 * sync::kMillisecond;
  static constexpr int64_t kLongestPenalty = 64;  // times cut_penalty_ns
  static constexpr sync::TimeNs kFirstCall = 200 * sync::kMillisecond;
  // Connections younger than kFirstCall may exceed a limit by this factor.
  static constexpr uint32_t kYoungBeyond = 2;
  // Maximum number of refused addresses. Further ones replace those that expire first.
  static constexpr size_t kMostPenalties = 4096;

  // All arguments must outlive the guard; `log` may be null.
  Guard(const ConnectionLimits& limits, sync::Clock& clock, Counters& counters, Logger* log)
      : limits_(limits), clock_(clock), counters_(counters), gate_(clock, log) {}

  // Returns: the limit on the first message of a first call, derived from unauthorised_bytes.
  uint64_t most_first_message() const { return limits_.unauthorised_bytes / 4 * 3; }

  // ---- called by the listener

  // Checks whether another connection of `peer` is allowed. Counts and logs refusals. May
  // disconnect another connection to make room. Errors: ResourceExhausted with the exceeded limit,
  // or Unavailable while the address is refused.
  absl::Status MayEnter(const Peer& peer);
  // Adds an accepted connection. `own`: it is the daemon's own and counts only against the limits
  // on bytes and time.
  ConnectionId Enter(const Peer& peer, bool own, std::unique_ptr<Wire> wire);
  // Disconnects a connection that did not begin with a call, because of `why`.
  void OnWrongGreeting(ConnectionId id, const std::string& why);
  // Removes a closed connection and destroys its wire.
  void Leave(ConnectionId id);
  // Reports that bytes have arrived.
  void OnBytes(ConnectionId id);
  // Checks all unauthorised connections. Returns: the time of the next check; kNever if there are
  // no such connections.
  sync::TimeNs Look();

  // ---- called by the services: `peer` is the result of PeerName

  // Reports that a call has received its first message. The call will be answered or end.
  void OnMessage(const std::string& peer);
  // Reports that a call is about to be answered. `authorises`: removes the limits on bytes and
  // time; otherwise resets them.
  void OnAnswer(const std::string& peer, bool authorises);
  // Reports the end of a call for which OnMessage was called.
  void OnCallEnd(const std::string& peer);

  // Sets the callback that announces connections with new bytes, or null. It is called with the
  // guard's lock held when TakeBusy has something to return and had nothing before.
  void SetOnBusy(std::function<void()> on_busy);
  struct Busy {
    std::string peer;
    uint64_t bytes = 0;  // in total
  };
  // Returns: the TCP connections that have received bytes since the last call.
  std::vector<Busy> TakeBusy();
  // `bytes` must be the value from TakeBusy, which was read before `figures`.
  void OnFigures(const Busy& busy, const CallFigures& figures);

 private:
  struct Connection {
    ConnectionId id = 0;
    std::string name, address;
    bool own = false, unix_socket = false;
    std::shared_ptr<Wire> wire;
    sync::TimeNs entered = 0;
    sync::TimeNs since = 0;  // accepted, or a call ended or was answered without authorising it
    uint64_t base = 0;       // bytes received by then, if a call was answered
    uint32_t waiting = 0;    // calls that the daemon has not answered yet
    bool watched = false;    // not authorised yet
    bool answered = false;   // a call was answered that does not authorise it
    bool cut = false;
    bool counted = false;  // against the limits
    bool authorised = false;
    sync::TimeNs many_since = sync::kNever;  // since when few of the bytes have been left
    // The start of the second in which cancelled calls are counted, and their number before it.
    sync::TimeNs cancelled_since = 0;
    uint64_t cancelled_before = 0;
    // State of the call counts and bytes at the last progress.
    uint64_t progress = 0, progress_bytes = 0;
  };
  struct Penalty {
    sync::TimeNs length = 0, until = 0;
  };
  // Numbers of connections that count against a limit.
  struct Counted {
    uint32_t open = 0, authorised = 0;
  };
  // A connection to disconnect after the lock is released.
  struct Doomed {
    std::shared_ptr<Wire> wire;
    std::string name, why;
  };

  Connection* Find(const std::string& peer) VOXELD_REQUIRES(mutex_);
  // Returns: whether the connection has received too many bytes; it is then doomed. `ended`: there
  // will be no later check.
  bool BytesAreMany(Connection& connection, bool ended, std::vector<Doomed>& doomed)
      VOXELD_REQUIRES(mutex_);
  void MarkBusy(const Connection& connection) VOXELD_REQUIRES(mutex_);
  void Uncount(Connection& connection) VOXELD_REQUIRES(mutex_);
  Counted CountOf(const std::string& address) const VOXELD_REQUIRES(mutex_);
  // Returns: whether there is no place for another connection. `address`: its address if the limit
  // is for one address; empty: the limit is for all.
  bool IsFull(const Counted& counted, uint32_t limit, const std::string& address,
              std::vector<Doomed>& doomed) VOXELD_REQUIRES(mutex_);
  // Disconnects the unauthorised connection that has been idle longest, of `address` or (empty) of
  // all. Returns: false if all are still within the time for their first call.
  bool MakeRoom(const std::string& address, std::vector<Doomed>& doomed) VOXELD_REQUIRES(mutex_);
  // Disconnects connections until no limit is exceeded, as far as kFirstCall permits.
  void MakeAllRoom(std::vector<Doomed>& doomed) VOXELD_REQUIRES(mutex_);
  void Doom(Connection& connection, Counters::Count& counter, std::string why, bool punished,
            std::vector<Doomed>& doomed) VOXELD_REQUIRES(mutex_);
  void Punish(const Connection& connection) VOXELD_REQUIRES(mutex_);
  void Cut(const std::vector<Doomed>& doomed);

  const ConnectionLimits limits_;
  sync::Clock& clock_;
  Counters& counters_;
  LogGate gate_;
  sync::Mutex mutex_;
  ConnectionId next_ VOXELD_GUARDED_BY(mutex_) = 1;
  std::unordered_map<ConnectionId, Connection> connections_ VOXELD_GUARDED_BY(mutex_);
  std::map<ConnectionId, Connection*> watched_ VOXELD_GUARDED_BY(mutex_);  // oldest first
  std::set<ConnectionId> busy_ VOXELD_GUARDED_BY(mutex_);
  std::function<void()> on_busy_ VOXELD_GUARDED_BY(mutex_);
  std::unordered_map<std::string, ConnectionId> by_name_ VOXELD_GUARDED_BY(mutex_);
  // Counts of connections by address.
  std::unordered_map<std::string, Counted> by_address_ VOXELD_GUARDED_BY(mutex_);
  std::map<std::string, Penalty> penalties_ VOXELD_GUARDED_BY(mutex_);
  Counted counted_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::listen
