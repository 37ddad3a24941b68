// The gRPC server: both services, health and reflection, on any number of addresses.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/address/address.h"
#include "daemon/core/core.h"
#include "daemon/local/local_socket.h"
#include "daemon/log/logger.h"
#include "daemon/services/context.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::services {

struct ServerOptions {
  std::vector<Address> listen;  // at least one
  std::string version;
  StreamLimits streams;
  uint32_t max_calls_per_connection = 256;
  // An idle connection is probed this often, and closed when no answer comes in time.
  sync::TimeNs keepalive_interval_ns = 20 * sync::kSecond;
  sync::TimeNs keepalive_timeout_ns = 10 * sync::kSecond;
  // Where producers on this machine hand over memory; nothing: nowhere.
  std::optional<local::LocalSocketOptions> local;
  Logger* log = nullptr;  // outlives the server; may be none
};

// Thread-safe. The core must run, outlive the server, and be stopped after it.
class Server {
 public:
  // Listens and serves, or says which address could not be had: AlreadyExists if somebody listens
  // there. Unix sockets get the mode 0660.
  static absl::StatusOr<std::unique_ptr<Server>> Start(Core& core, sync::Clock& clock,
                                                       ServerOptions options);
  ~Server();  // shuts down, if that has not been done
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // Where it listens, with the ports that were chosen.
  const std::vector<Address>& addresses() const;

  // What health answers, for every service, until Shutdown.
  void SetServing(bool serving);

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
