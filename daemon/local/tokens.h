// Which session a connection to the local socket belongs to: whoever says a session's token.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "daemon/core/core.h"
#include "daemon/local/doorbell.h"
#include "daemon/local/local_memory.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::local {

// Thread-safe.
class Tokens {
 public:
  static constexpr size_t kBytes = 16;

  // `ended` is rung when a session ends.
  Tokens(const LocalLimits& limits, std::shared_ptr<const Doorbell> ended)
      : limits_(limits), ended_(std::move(ended)) {}

  struct Registered {
    std::string token;  // kBytes random bytes
    std::shared_ptr<LocalMemory> memory;
  };
  // Unavailable if the system has no random bytes. A session is registered once.
  absl::StatusOr<Registered> Register(SessionId session);

  // Ends its memory. Nothing if it is not registered.
  void Unregister(SessionId session);

  struct Found {
    SessionId session = 0;
    std::shared_ptr<LocalMemory> memory;  // null: nobody has this token
  };
  // Takes as long whatever is wrong with the token.
  Found Find(std::string_view token) const;

  const LocalLimits& limits() const { return limits_; }

 private:
  const LocalLimits limits_;
  const std::shared_ptr<const Doorbell> ended_;
  const std::shared_ptr<std::atomic<uint32_t>> mapped_ = std::make_shared<std::atomic<uint32_t>>(0);
  mutable sync::Mutex mutex_;
  std::map<SessionId, Registered> sessions_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::local
