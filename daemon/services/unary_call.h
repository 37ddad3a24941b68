// A short call: one request and one answer from the core. At shutdown it may end without that
// answer, so that a busy core delays nobody.
#pragma once

#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "daemon/services/active_calls.h"
#include "display/sync/mutex.h"

namespace grpc {
class ServerUnaryReactor;
}

namespace voxeld::daemon::services {

// Thread-safe. A pending answer may hold it for any time, even after the server has been destroyed.
class UnaryCall final : public ActiveCall, public std::enable_shared_from_this<UnaryCall> {
 public:
  // Creates the call of `reactor` and adds it to `calls`, from which it is removed when it ends.
  static std::shared_ptr<UnaryCall> Begin(ActiveCalls& calls, grpc::ServerUnaryReactor* reactor);

  UnaryCall(ActiveCalls& calls, grpc::ServerUnaryReactor* reactor)
      : calls_(calls), reactor_(reactor) {}

  // Ends the call with `status`, unless it has already ended. `fill` writes the response: it runs
  // before this returns, and only if the response still exists.
  void Answer(const absl::Status& status, const std::function<void()>& fill);
  void End(const absl::Status& status) override { Answer(status, nullptr); }

 private:
  // Both are invalid after the call has ended.
  ActiveCalls& calls_;
  grpc::ServerUnaryReactor* const reactor_;
  sync::Mutex mutex_;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::daemon::services
