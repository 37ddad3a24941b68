// The local socket: where producers on this machine hand over bulk content without sending it
// (voxeld/v1/local.proto). One thread; nothing that a client does or leaves holds up another.
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
  Address listen;  // a unix socket
  LocalLimits limits;
  // Connections that have not said Hello: further ones wait to be accepted. With Hello there is one
  // of each session: a newer one takes the place of the older, which ends.
  uint32_t max_without_hello = 64;
  sync::TimeNs hello_limit_ns = 2 * sync::kSecond;
  std::shared_ptr<Budget> budget;  // charged for what is held; may be none
  Logger* log = nullptr;           // may be none
};

class LocalSocket {
 public:
  // Listens and serves, with the mode 0660; AlreadyExists if somebody listens there. The clock and
  // the log outlive it.
  static absl::StatusOr<std::unique_ptr<LocalSocket>> Start(sync::Clock& clock,
                                                            LocalSocketOptions options);
  // Ends every connection, removes the socket and joins the thread. Sessions that are registered
  // still keep their tokens, which are good for nothing then.
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
