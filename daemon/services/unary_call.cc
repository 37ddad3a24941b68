#include "daemon/services/unary_call.h"

#include <grpcpp/support/server_callback.h>

#include "daemon/services/status.h"

namespace voxeld::daemon::services {

std::shared_ptr<UnaryCall> UnaryCall::Begin(ActiveCalls& calls, grpc::ServerUnaryReactor* reactor) {
  auto call = std::make_shared<UnaryCall>(calls, reactor);
  calls.Add(call);
  return call;
}

void UnaryCall::Answer(const absl::Status& status, const std::function<void()>& fill) {
  {
    sync::MutexLock lock(mutex_);
    if (ended_) return;
    ended_ = true;
    if (fill) fill();
  }
  // The order matters: the server exists until the reactor has finished, and `calls_` as long as
  // the server.
  calls_.Remove(this);
  reactor_->Finish(ToGrpc(status));
}

}  // namespace voxeld::daemon::services
