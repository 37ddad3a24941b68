// The daemon's own listener accepts connections on every address and hands them to a server. gRPC's
// listener stops for good once descriptors run out, and has no limits.
//
//   out of descriptors   Clients wait in the system's queue; the listener retries every kRetry.
//   over a limit         The connection is closed at once, counted and logged (guard.h). After many
//                        refusals the address rests for the remainder of kRefusalInterval, so that
//                        they cost other clients little.
//   over TCP             The listener keeps connections until a call begins (greeting.h).
//   the rest             Stays under the guard until it is closed.
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

// Names (PeerOf) of sockets with which the daemon connects to itself. Thread-safe.
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

// Properties of an accepted connection.
struct Accepted {
  int listening = -1;            // the socket that accepted it
  bool tls = false;              // whether it uses TLS
  std::optional<uint32_t> user;  // user of a unix socket, according to the kernel
};

// Takes ownership of an accepted connection, whose descriptor is non-blocking. Returns: false if it
// was closed because no server can take it. Called on the listener's thread.
using Serve = std::function<bool(const Accepted& accepted, Descriptor connection)>;

struct ListenerOptions {
  // A connection is closed if its other end does not acknowledge sent data within this time.
  sync::TimeNs send_limit_ns = 10 * sync::kSecond;
  Logger* log = nullptr;  // outlives the listener; may be null
};

// Thread-safe. Socket timeouts use system time; all other times are those of the clock.
class Listener {
 public:
  static constexpr sync::TimeNs kRetry = 100 * sync::kMillisecond;
  // Refusals per interval. Further connections wait in the system's queue, together with all that
  // follow them.
  static constexpr int kRefusals = 16;
  static constexpr sync::TimeNs kRefusalInterval = 10 * sync::kMillisecond;

  // Starts accepting on a separate thread. `guard`, `counters`, `own` and the clock must outlive
  // the listener.
  static absl::StatusOr<std::unique_ptr<Listener>> Start(std::vector<ListeningSocket> sockets,
                                                         Guard& guard, Counters& counters,
                                                         const OwnPeers& own, sync::Clock& clock,
                                                         Serve serve, ListenerOptions options);
  // Drops its connections; those that a server has taken continue.
  ~Listener();
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;

  // Closes the listening sockets. `serve` is not called again after this returns; the guard
  // continues.
  void StopAccepting();

 private:
  class Impl;
  explicit Listener(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::listen
