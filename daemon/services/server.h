// The gRPC server: both services, health and reflection, on any number of addresses, behind a
// listener of our own (daemon/listen).
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
  // Of messages that come in, until they are whole (gRPC's resource quota).
  uint64_t max_arriving_bytes = uint64_t{1} << 30;
  listen::ConnectionLimits connections;
  // Where the listener counts; none: nobody asks.
  std::shared_ptr<listen::Counters> counters;
  uint32_t max_calls_per_connection = 100;
  uint32_t max_metadata_bytes = 8u << 10;
  sync::TimeNs handshake_limit_ns = 2 * sync::kSecond;
  sync::TimeNs ping_interval_min_ns = 5 * sync::kSecond;
  uint32_t max_ping_strikes = 2;
  // 0: never.
  sync::TimeNs connection_idle_limit_ns = 0, connection_age_limit_ns = 0;
  sync::TimeNs connection_age_grace_ns = 60 * sync::kSecond;
  uint32_t max_scene_watches = 64;
  uint32_t max_stats_watches = 64;
  uint32_t max_volume_watches = 16;
  // An idle connection is probed this often, and closed when no answer comes in time.
  sync::TimeNs keepalive_interval_ns = 20 * sync::kSecond;
  sync::TimeNs keepalive_timeout_ns = 10 * sync::kSecond;
  // Where producers on this machine hand over memory, charged to the core's budget; nothing: nowhere.
  std::optional<local::LocalSocketOptions> local;
  // All three outlive the server. No access: everybody may do everything. No tls: no address may ask
  // for it.
  const access::Access* access = nullptr;
  const access::TlsStore* tls = nullptr;
  access::Audit* audit = nullptr;
  assets::AssetStore* assets = nullptr;  // outlives the server; none: none are kept
  Logger* log = nullptr;                 // outlives the server; may be none
};

// Thread-safe. The core must run, outlive the server, and be stopped after it.
class Server {
 public:
  // Listens and serves, or says which address could not be had: AlreadyExists if somebody listens
  // there. Unix sockets get the mode 0660.
  // `inherited`: sockets that listen already; an address of `listen` that one of them has is not asked
  // for again.
  static absl::StatusOr<std::unique_ptr<Server>> Start(
      Core& core, sync::Clock& clock, ServerOptions options,
      std::vector<listen::ListeningSocket> inherited = {});
  ~Server();  // shuts down, if that has not been done
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Where it listens, with the ports that were chosen.
  const std::vector<Address>& addresses() const;

  // What health answers, for every service, until Shutdown: also while the server cannot be reached,
  // by its own probe's word, it is NOT_SERVING.
  void SetServing(bool serving);

  // Ends the long calls of whoever may not make them any more (Access::Recheck). Answers how many.
  size_t EndRevoked();

  // Health answers NOT_SERVING, nothing new is accepted, every long call ends with
  // `Unavailable: shutting down` after what is queued for it. Returns when all calls have ended,
  // after at most `limit`: then those left are cancelled, and short ones are Unavailable, whatever
  // the core is busy with. What it answers later is dropped.
  void Shutdown(sync::TimeNs limit);

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::services
