// The daemon's own listener: accepts on every address and hands connections to whoever serves them.
// gRPC's own gives up for good when descriptors run out once, and has no limits.
//
//   out of descriptors   clients wait in the system's queue; the listener tries again every kRetry
//   over a limit         closed at once, counted, logged (guard.h); when many are, an address is left
//                        alone for the rest of kRefusalInterval, so that they cost others little
//   over TCP             kept here until a call begins (greeting.h), and only then served
//   the rest             under the guard until it is closed
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/listen/counters.h"
#include "daemon/listen/guard.h"
#include "daemon/listen/limits.h"
#include "daemon/listen/socket.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::listen {

// Names (PeerOf) of sockets that the daemon connects with to itself. Thread-safe.
class OwnPeers {
 public:
  void Add(const std::string& name) {
    sync::MutexLock lock(mutex_);
    names_.insert(name);
  }
  void Remove(const std::string& name) {
    sync::MutexLock lock(mutex_);
    names_.erase(name);
  }
  bool Has(const std::string& name) const {
    sync::MutexLock lock(mutex_);
    return names_.contains(name);
  }

 private:
  mutable sync::Mutex mutex_;
  std::set<std::string> names_ VOXELD_GUARDED_BY(mutex_);
};

// What is known of an accepted connection.
struct Accepted {
  int listening = -1;            // the socket that it came to
  bool tls = false;              // what it speaks
  std::optional<uint32_t> user;  // of a unix socket: whose it is, by the kernel's word
};

// Takes an accepted connection, whose descriptor is non-blocking and now theirs. False: it was closed,
// as nobody can serve it. Called on the listener's thread.
using Serve = std::function<bool(const Accepted& accepted, Descriptor connection)>;

struct ListenerOptions {
  // A connection whose other end does not acknowledge what is sent is given up after it.
  sync::TimeNs send_limit_ns = 10 * sync::kSecond;
  Logger* log = nullptr;  // outlives the listener; may be none
};

// Thread-safe. Waits are the system's, as sockets know no other; all else goes by the clock.
class Listener {
 public:
  static constexpr sync::TimeNs kRetry = 100 * sync::kMillisecond;
  // So many are refused in an interval; those beyond wait in the system's queue, and with them
  // whoever comes after them.
  static constexpr int kRefusals = 16;
  static constexpr sync::TimeNs kRefusalInterval = 10 * sync::kMillisecond;

  // `guard`, `counters`, `own` and the clock outlive the listener. Accepts from now on, on a thread
  // of its own.
  static absl::StatusOr<std::unique_ptr<Listener>> Start(std::vector<ListeningSocket> sockets,
                                                         Guard& guard, Counters& counters,
                                                         const OwnPeers& own, sync::Clock& clock,
                                                         Serve serve, ListenerOptions options);
  // Lets go of the connections; whoever serves them goes on.
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  // Closes the listening sockets. When it returns `serve` will not be called again; the guard goes on.
  void StopAccepting();

 private:
  class Impl;
  explicit Listener(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::listen
