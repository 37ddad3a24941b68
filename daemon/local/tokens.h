// Assigns connections of the local socket to sessions by the token that a client presents.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "daemon/core/budget.h"
#include "daemon/core/core.h"
#include "daemon/local/doorbell.h"
#include "daemon/local/local_memory.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::local {

// Thread-safe.
class Tokens {
 public:
  static constexpr size_t kBytes = 16;

  // `ended` is rung when a session ends. `budget` is charged for held memory; it may be null.
  Tokens(const LocalLimits& limits, std::shared_ptr<const Doorbell> ended,
         std::shared_ptr<Budget> budget)
      : limits_(limits), ended_(std::move(ended)), budget_(std::move(budget)) {}

  struct Registered {
    std::string token;  // kBytes random bytes
    std::shared_ptr<LocalMemory> memory;
  };
  // Registers a session. Each stream of a session registers separately, because a stream that
  // resumes the session may arrive before the older one has gone. Errors: Unavailable if the system
  // has no random bytes.
  absl::StatusOr<Registered> Register(SessionId session);

  // Ends the memory of the token. Does nothing if the token is unknown.
  void Unregister(const std::string& token);

  struct Found {
    SessionId session = 0;
    std::shared_ptr<LocalMemory> memory;  // null: the token is unknown
  };
  // Takes the same time for every invalid token.
  Found Find(std::string_view token) const;

  const LocalLimits& limits() const { return limits_; }

 private:
  const LocalLimits limits_;
  const std::shared_ptr<const Doorbell> ended_;
  const std::shared_ptr<Budget> budget_;
  const std::shared_ptr<std::atomic<uint32_t>> mapped_ = std::make_shared<std::atomic<uint32_t>>(0);
  mutable sync::Mutex mutex_;
  std::map<std::string, Found> by_token_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::local
