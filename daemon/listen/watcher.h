// Watches guarded connections on a separate thread, so that accepting and serving them never delays
// it.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"
#include "daemon/listen/guard.h"
#include "daemon/listen/peer.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::listen {

// Thread-safe. Waits use system time; all other times are those of the clock.
class Watcher {
 public:
  // `guard` and the clock must outlive the watcher.
  static absl::StatusOr<std::unique_ptr<Watcher>> Start(Guard& guard, sync::Clock& clock);
  ~Watcher();  // removes the connections from the guard
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  // Adds a connection; it is removed when it has been closed in both directions. `own`: see
  // Guard::Enter. Errors: the system's, if it cannot watch the connection, which is then not added.
  absl::StatusOr<ConnectionId> Add(const Peer& peer, bool own, Descriptor connection);

 private:
  class Impl;
  explicit Watcher(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::listen
