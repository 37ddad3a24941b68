// The local socket, through which producers on this machine hand over bulk content without sending
// it (voxeld/v1/local.proto). It uses one thread; no client can delay another.
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "daemon/address/address.h"
#include "daemon/core/budget.h"
#include "daemon/local/local_memory.h"
#include "daemon/local/tokens.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::local {

struct LocalSocketOptions {
  Address listen;  // must be a unix socket
  LocalLimits limits;
  // Connections that have not sent Hello; further ones wait to be accepted. After Hello there is
  // one connection per session: a newer one replaces the older one, which is closed.
  uint32_t max_without_hello = 64;
  sync::TimeNs hello_limit_ns = 2 * sync::kSecond;
  std::shared_ptr<Budget> budget;  // charged for held memory; may be null
  Logger* log = nullptr;           // may be null
};

class LocalSocket {
 public:
  // Listens and serves with mode 0660. The clock and the log must outlive the socket. Errors:
  // AlreadyExists if another server listens there.
  static absl::StatusOr<std::unique_ptr<LocalSocket>> Start(sync::Clock& clock,
                                                            LocalSocketOptions options);
  // Closes every connection, removes the socket and joins the thread. Registered sessions keep
  // their tokens, which no longer work.
  ~LocalSocket();
  LocalSocket(const LocalSocket&) = delete;
  LocalSocket& operator=(const LocalSocket&) = delete;

  const Address& address() const;
  const std::shared_ptr<Tokens>& tokens() const;

 private:
  class Impl;
  explicit LocalSocket(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace voxeld::daemon::local
