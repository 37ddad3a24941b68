// Looks at guarded connections, on a thread of its own: nothing that accepting and serving them
// involves may hold it up.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"
#include "daemon/listen/guard.h"
#include "daemon/listen/peer.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::listen {

// Thread-safe. Waits are the system's, all else goes by the clock.
class Watcher {
 public:
  // `guard` and the clock outlive the watcher.
  static absl::StatusOr<std::unique_ptr<Watcher>> Start(Guard& guard, sync::Clock& clock);
  ~Watcher();  // the guard forgets the connections
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  // A connection enters; it leaves when it has been closed in both directions. `own`: see
  // Guard::Enter. An error if the system has no means for it: then it has not entered.
  absl::StatusOr<ConnectionId> Add(const Peer& peer, bool own, Descriptor connection);

 private:
  class Impl;
  explicit Watcher(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::listen
