// Whether the daemon can be reached at all: it connects to each of its own addresses, as a client
// would, and asks for its health. A process that lives, and answers on connections that are open, may
// have long been deaf to new ones.
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
  SocketName name;   // that a listening socket has
  std::string text;  // for people
  bool tls = false;  // what it speaks
};

// Connects (to itself, if `target` is every address), asks for the health over HTTP/2, waits for the
// beginning of an answer; over TLS, for which it has no certificate that is trusted, for that of the
// handshake. The socket is among `own` while it is open. Blocks, `limit` at most.
absl::Status Reach(const ProbeTarget& target, OwnPeers& own, sync::TimeNs limit);

// Asks every interval, by the clock, on a thread of its own. Thread-safe.
class Probe {
 public:
  // So many in a row of one address make it unreachable; one that succeeds makes it well.
  static constexpr int kFailures = 2;
  static constexpr sync::TimeNs kLimit = 2 * sync::kSecond;  // for one address

  using Try = std::function<absl::Status(const ProbeTarget& target)>;  // mostly Reach
  // On the probe's thread, when it changes.
  using OnChange = std::function<void(bool reachable)>;

  // `counters`, the clock and `log`, which may be none, outlive the probe.
  Probe(std::vector<ProbeTarget> targets, sync::TimeNs interval, Try attempt, OnChange on_change,
        Counters& counters, sync::Clock& clock, Logger* log);
  ~Probe();  // waits for an attempt that is under way
  // No further attempt, and nobody is told what becomes of the present one. Does not wait.
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
  std::vector<int> failures_;  // in a row, of each target; the thread's own
  bool reachable_ = true;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace voxeld::daemon::listen
