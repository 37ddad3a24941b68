// Checks whether the daemon is reachable: connects to each of its addresses like a client and asks
// for its health. A process that runs and answers on open connections may still no longer accept
// new ones.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "daemon/listen/counters.h"
#include "daemon/listen/listener.h"
#include "daemon/listen/socket.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::listen {

struct ProbeTarget {
  SocketName name;   // of a listening socket
  std::string text;  // for people
  bool tls = false;  // whether it uses TLS
};

// Connects (to this machine if `target` is a wildcard address), asks for health over HTTP/2 and
// waits for the beginning of an answer. Over TLS it waits only for the handshake to begin, because
// it has no trusted certificate. The socket is registered in `own` while it is open. Blocks for at
// most `limit`.
absl::Status Reach(const ProbeTarget& target, OwnPeers& own, sync::TimeNs limit);

// Probes every interval of the clock, on a separate thread. Thread-safe.
class Probe {
 public:
  // An address is unreachable after this many consecutive failures, and reachable after one
  // success.
  static constexpr int kFailures = 2;
  static constexpr sync::TimeNs kLimit = 2 * sync::kSecond;  // for one address

  using Try = std::function<absl::Status(const ProbeTarget& target)>;  // normally Reach
  // Called on the probe's thread when the state changes.
  using OnChange = std::function<void(bool reachable)>;

  // `counters`, the clock and `log` must outlive the probe; `log` may be null.
  Probe(std::vector<ProbeTarget> targets, sync::TimeNs interval, Try attempt, OnChange on_change,
        Counters& counters, sync::Clock& clock, Logger* log);
  ~Probe();  // waits for a running attempt
  // Starts no further attempt and discards the result of the current one. Does not block.
  void Stop();
  Probe(const Probe&) = delete;
  Probe& operator=(const Probe&) = delete;

 private:
  void Run();
  void Round();
  bool Stopped();

  const std::vector<ProbeTarget> targets_;
  const sync::TimeNs interval_;
  const Try attempt_;
  const OnChange on_change_;
  Counters& counters_;
  sync::Clock& clock_;
  Logger* const log_;
  std::vector<int> failures_;  // consecutive, for each target; used by the probe's thread only
  bool reachable_ = true;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::daemon::listen
