// A short call: one request, one answer from the core. At shutdown it may be ended without, so that
// a core that is busy for long holds up nobody.
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

// Thread-safe. Whoever has yet to answer may hold it for as long as they like, also when the
// server is gone.
class UnaryCall final : public ActiveCall, public std::enable_shared_from_this<UnaryCall> {
 public:
  // The call that `reactor` stands for, among `calls`, which it leaves when it ends.
  static std::shared_ptr<UnaryCall> Begin(ActiveCalls& calls, grpc::ServerUnaryReactor* reactor);

  UnaryCall(ActiveCalls& calls, grpc::ServerUnaryReactor* reactor)
      : calls_(calls), reactor_(reactor) {}

  // Ends the call with `status`, unless it has ended. `fill` writes the response: it runs inside,
  // and only if the response is still there to be written.
  void Answer(const absl::Status& status, const std::function<void()>& fill);
  void End(const absl::Status& status) override { Answer(status, nullptr); }

 private:
  // Both are gone once the call has ended.
  ActiveCalls& calls_;
  grpc::ServerUnaryReactor* const reactor_;
  sync::Mutex mutex_;
  bool ended_ VOXELD_GUARDED_BY(mutex_) = false;
};

}  // namespace voxeld::daemon::services
