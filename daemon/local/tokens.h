// Which session a connection to the local socket belongs to: whoever says a session's token.
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

  // `ended` is rung when a session ends. `budget` is charged for what is held; it may be none.
  Tokens(const LocalLimits& limits, std::shared_ptr<const Doorbell> ended,
         std::shared_ptr<Budget> budget)
      : limits_(limits), ended_(std::move(ended)), budget_(std::move(budget)) {}

  struct Registered {
    std::string token;  // kBytes random bytes
    std::shared_ptr<LocalMemory> memory;
  };
  // Unavailable if the system has no random bytes. Each stream of a session registers for itself: one
  // that takes the session up may come before the older one has gone.
  absl::StatusOr<Registered> Register(SessionId session);

  // Ends the memory that goes with the token. Nothing if there is none.
  void Unregister(const std::string& token);

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
  const std::shared_ptr<Budget> budget_;
  const std::shared_ptr<std::atomic<uint32_t>> mapped_ = std::make_shared<std::atomic<uint32_t>>(0);
  mutable sync::Mutex mutex_;
  std::map<std::string, Found> by_token_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::local
