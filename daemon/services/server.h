// The gRPC server: both services, health and reflection, on any number of addresses, behind the
// daemon's own listener (daemon/listen).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/access/access.h"
#include "daemon/access/audit.h"
#include "daemon/access/tls_store.h"
#include "daemon/address/address.h"
#include "daemon/core/core.h"
#include "daemon/listen/counters.h"
#include "daemon/listen/limits.h"
#include "daemon/listen/socket.h"
#include "daemon/local/local_socket.h"
#include "daemon/log/logger.h"
#include "daemon/services/context.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::services {

struct ServerOptions {
  std::vector<Address> listen;  // at least one
  std::string version;
  StreamLimits streams;
  // Limit on incomplete incoming messages (gRPC's resource quota).
  uint64_t max_arriving_bytes = uint64_t{1} << 30;
  listen::ConnectionLimits connections;
  // The listener's counters; null: not counted.
  std::shared_ptr<listen::Counters> counters;
  uint32_t max_calls_per_connection = 100;
  uint32_t max_metadata_bytes = 8u << 10;
  sync::TimeNs handshake_limit_ns = 2 * sync::kSecond;
  sync::TimeNs ping_interval_min_ns = 5 * sync::kSecond;
  uint32_t max_ping_strikes = 2;
  // 0: unlimited.
  sync::TimeNs connection_idle_limit_ns = 0, connection_age_limit_ns = 0;
  sync::TimeNs connection_age_grace_ns = 60 * sync::kSecond;
  uint32_t max_scene_watches = 64;
  uint32_t max_stats_watches = 64;
  uint32_t max_volume_watches = 16;
  // An idle connection is probed this often, and closed if no answer arrives in time.
  sync::TimeNs keepalive_interval_ns = 20 * sync::kSecond;
  sync::TimeNs keepalive_timeout_ns = 10 * sync::kSecond;
  // Local socket, where producers on this machine hand over memory that is charged to the core's
  // budget; nothing: disabled.
  std::optional<local::LocalSocketOptions> local;
  // All three must outlive the server. `access` null: everybody has all scopes. `tls` null: no
  // address may use TLS.
  const access::Access* access = nullptr;
  const access::TlsStore* tls = nullptr;
  access::Audit* audit = nullptr;
  assets::AssetStore* assets = nullptr;  // must outlive the server; null: uploads are rejected
  Logger* log = nullptr;                 // must outlive the server; may be null
};

// Thread-safe. The core must be running, outlive the server, and be stopped after it.
class Server {
 public:
  // Listens and serves. Unix sockets get mode 0660. `inherited` are sockets that already listen; an
  // address of `listen` that one of them has is not opened again. Errors: the address that failed,
  // with AlreadyExists if another server listens there.
  static absl::StatusOr<std::unique_ptr<Server>> Start(
      Core& core, sync::Clock& clock, ServerOptions options,
      std::vector<listen::ListeningSocket> inherited = {});
  ~Server();  // shuts down unless Shutdown was called
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Returns: the addresses with the chosen ports.
  const std::vector<Address>& addresses() const;

  // Sets the health status of every service until Shutdown. While the server's own probe finds it
  // unreachable, the status is NOT_SERVING in any case.
  void SetServing(bool serving);

  // Ends the streaming calls of callers that have lost their scopes (Access::Recheck). Returns: the
  // number of calls.
  size_t EndRevoked();

  // Sets health to NOT_SERVING, accepts nothing new, and ends every streaming call with
  // `Unavailable: shutting down` after what is queued for it. Returns when all calls have ended, at
  // most after `limit`: the remaining calls are then cancelled, and short ones end with Unavailable
  // even if the core is busy. Later answers of the core are dropped.
  void Shutdown(sync::TimeNs limit);

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::services
