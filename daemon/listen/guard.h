// Cuts connections that cost more than a client may before it is trusted. gRPC parses headers, at any
// length and price, before anybody can refuse them; what it is fed is what can be bounded.
//
//   greeting      what comes is not the beginning of a call (greeting.h): cut, before gRPC saw it
//   bytes         more than unauthorised_bytes came: cut. Looked at whenever some come, at each
//                 Look, when a call of it is answered, and when it ends
//   time          unauthorised_limit_ns went by: cut. It stands still while a call waits for the
//                 daemon's answer, as a core that is busy is no fault of the client's
//   authorised    a call that authorises (call_watch.h) was answered: from then on bytes and time are
//                 not limited any more. The answer of another, health's say, begins both anew
//   cancelling    always: more calls than max_cancelled_calls_per_second ended without an answer
//                 within a second: cut
//   flooding      of the authorised: more bytes than messages and calls under way can have came, and
//                 no call began and no message was whole: cut
//
// Looking takes time, so what is near a limit is cut as well: a sixteenth before the end of the time,
// and where less than three sixteenths of the bytes are left for kGrace. Until it is authorised a
// connection's receive buffer is small (Wire::Trust), so that little comes between a limit and the cut.
//
// The address of a connection that was cut, but for time or for room, is refused for a while: cut_penalty_ns, and
// twice as long each time that it comes back and is cut again.
//
// Where max_connections or max_connections_per_address are open, the unauthorised connection that has been idle longest is cut,
// so that strangers who say nothing keep nobody away. Each has kFirstCall, in which to make its first call; meanwhile twice
// as many may be open. Only where all are authorised or at work is a further one refused.
//
// Unix sockets, whose users the kernel names, are free of all this but the limits on connections:
// gRPC has no names for them by which their calls could be told apart. Times are the clock's.
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

// A connection's socket, as the guard needs it. Thread-safe.
class Wire {
 public:
  virtual ~Wire() = default;
  virtual uint64_t BytesReceived() = 0;
  virtual void Cut() = 0;    // at once, in both directions; what was received is thrown away
  virtual void Trust() = 0;  // as much may come at once as with any other socket
  // Guard::OnBytes is called once, when there are bytes to read, or Leave, when it has ended; again only
  // after the next Arm. Until the first one that is so whenever some come.
  virtual void Arm() = 0;
};

using ConnectionId = uint64_t;

// What gRPC says of a connection's calls, since it was accepted.
struct CallFigures {
  uint64_t cancelled = 0;  // ended without an answer
  uint64_t progress = 0;   // calls that began and messages that came: more is better
  uint64_t open = 0;       // calls under way
};

// Thread-safe.
class Guard {
 public:
  // How often unauthorised connections are looked at.
  static constexpr sync::TimeNs kLookInterval = 20 * sync::kMillisecond;
  // Shorter than a system waits before it tries a closed window again (200 ms): a client that sends
  // on before it is answered waits in its own system, and is not cut if the answer comes within it.
  static constexpr sync::TimeNs kGrace = 100 * sync::kMillisecond;
  static constexpr int64_t kLongestPenalty = 64;  // of cut_penalty_ns
  static constexpr sync::TimeNs kFirstCall = 200 * sync::kMillisecond;
  // Connections younger than kFirstCall may exceed a limit by this factor.
  static constexpr uint32_t kYoungBeyond = 2;
  // Addresses that are refused at once; further ones replace those whose time is over first.
  static constexpr size_t kMostPenalties = 4096;

  // All outlive the guard; `log` may be none.
  Guard(const ConnectionLimits& limits, sync::Clock& clock, Counters& counters, Logger* log)
      : limits_(limits), clock_(clock), counters_(counters), gate_(clock, log) {}

  // Of the first message of a first call: what unauthorised_bytes leaves it.
  uint64_t most_first_message() const { return limits_.unauthorised_bytes / 4 * 3; }

  // ---- from the listener

  // Whether another connection of `peer` may be had, counted and logged: ResourceExhausted says
  // which limit it would go beyond, Unavailable that its address is refused for a while. May cut another one to make room.
  absl::Status MayEnter(const Peer& peer);
  // From accept on. `own`: the daemon's own, which counts against no limit but those of bytes and
  // time.
  ConnectionId Enter(const Peer& peer, bool own, std::unique_ptr<Wire> wire);
  // What came is no beginning of a call, `why`: it is cut.
  void OnWrongGreeting(ConnectionId id, const std::string& why);
  // It has been closed. The wire goes.
  void Leave(ConnectionId id);
  // Bytes came.
  void OnBytes(ConnectionId id);
  // Looks at all unauthorised connections. When to look again; kNever if there are none.
  sync::TimeNs Look();

  // ---- from the services: `peer` as PeerName gives it

  // A call got its first message, and will answer it or end.
  void OnMessage(const std::string& peer);
  // It is about to be answered. `authorises`: for good; else bytes and time begin anew.
  void OnAnswer(const std::string& peer, bool authorises);
  // Of a call for which OnMessage was called.
  void OnCallEnd(const std::string& peer);

  // Who looks at the calls of connections that get bytes; null: nobody. `on_busy` is called, with the
  // guard's lock held, when TakeBusy has something after it had nothing.
  void SetOnBusy(std::function<void()> on_busy);
  struct Busy {
    std::string peer;
    uint64_t bytes = 0;  // in all
  };
  // Connections over TCP that have got bytes since they were taken last.
  std::vector<Busy> TakeBusy();
  // `bytes` as TakeBusy gave them, before the figures were asked for.
  void OnFigures(const Busy& busy, const CallFigures& figures);

 private:
  struct Connection {
    ConnectionId id = 0;
    std::string name, address;
    bool own = false, unix_socket = false;
    std::shared_ptr<Wire> wire;
    sync::TimeNs entered = 0;
    sync::TimeNs since = 0;  // accepted, or a call ended or was answered without authorising it
    uint64_t base = 0;       // bytes that had come by then, if it was answered
    uint32_t waiting = 0;    // calls that the daemon has yet to answer
    bool watched = false;    // not authorised yet
    bool answered = false;   // a call was answered that does not authorise it
    bool cut = false;
    bool counted = false;  // against the limits
    bool authorised = false;
    sync::TimeNs many_since = sync::kNever;  // few of the bytes are left
    // The second in which cancelled calls are counted, and those before it.
    sync::TimeNs cancelled_since = 0;
    uint64_t cancelled_before = 0;
    // When something last came of the bytes.
    uint64_t progress = 0, progress_bytes = 0;
  };
  struct Penalty {
    sync::TimeNs length = 0, until = 0;
  };
  // Connections that count against a limit.
  struct Counted {
    uint32_t open = 0, authorised = 0;
  };
  // A connection that is to be cut when the lock is free.
  struct Doomed {
    std::shared_ptr<Wire> wire;
    std::string name, why;
  };

  Connection* Find(const std::string& peer) VOXELD_REQUIRES(mutex_);
  // Whether its bytes are too many: then it is doomed. `ended`: there will be no later look.
  bool BytesAreMany(Connection& connection, bool ended, std::vector<Doomed>& doomed)
      VOXELD_REQUIRES(mutex_);
  void MarkBusy(const Connection& connection) VOXELD_REQUIRES(mutex_);
  void Uncount(Connection& connection) VOXELD_REQUIRES(mutex_);
  Counted CountOf(const std::string& address) const VOXELD_REQUIRES(mutex_);
  // Returns: whether another connection has no place. `address`: its address if the limit is for one address; empty: the limit is
  // for all.
  bool IsFull(const Counted& counted, uint32_t limit, const std::string& address,
              std::vector<Doomed>& doomed) VOXELD_REQUIRES(mutex_);
  // Cuts the unauthorised connection that has been idle longest, of `address` or (empty) of all. Returns: false if none has had its
  // time for a first call.
  bool MakeRoom(const std::string& address, std::vector<Doomed>& doomed) VOXELD_REQUIRES(mutex_);
  // Cuts connections until no limit is exceeded, as far as that is possible yet.
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
  // Of those that count against limits.
  std::unordered_map<std::string, Counted> by_address_ VOXELD_GUARDED_BY(mutex_);
  std::map<std::string, Penalty> penalties_ VOXELD_GUARDED_BY(mutex_);
  Counted counted_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::listen
