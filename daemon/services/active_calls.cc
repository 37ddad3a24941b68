#include "daemon/services/active_calls.h"

#include <utility>
#include <vector>

namespace voxeld::daemon::services {

void ActiveCalls::Add(std::shared_ptr<ActiveCall> call) {
  std::optional<absl::Status> ended;
  {
    sync::MutexLock lock(mutex_);
    calls_.emplace(call.get(), call);
    ended = ended_;
  }
  if (ended.has_value()) call->End(*ended);
}

void ActiveCalls::Remove(const ActiveCall* call) {
  std::shared_ptr<ActiveCall> last;  // destroyed without the lock
  sync::MutexLock lock(mutex_);
  const auto it = calls_.find(call);
  if (it == calls_.end()) return;
  last = std::move(it->second);
  calls_.erase(it);
  removed_.NotifyAll();
}

void ActiveCalls::EndAll(const absl::Status& status) {
  std::vector<std::shared_ptr<ActiveCall>> calls;
  {
    sync::MutexLock lock(mutex_);
    ended_ = status;
    calls.reserve(calls_.size());
    for (const auto& [key, call] : calls_) calls.push_back(call);
  }
  for (const auto& call : calls) call->End(status);
}

size_t ActiveCalls::EndRevoked(const std::function<absl::Status(const access::Caller&)>& check) {
  std::vector<std::pair<std::shared_ptr<ActiveCall>, absl::Status>> revoked;
  {
    sync::MutexLock lock(mutex_);
    for (const auto& [key, call] : calls_) {
      absl::Status status = check(call->caller());
      if (!status.ok()) revoked.emplace_back(call, std::move(status));
    }
  }
  for (const auto& [call, status] : revoked) call->End(status);
  return revoked.size();
}

size_t ActiveCalls::AwaitNone(sync::Clock& clock, sync::TimeNs deadline) {
  sync::MutexLock lock(mutex_);
  while (!calls_.empty() && clock.Now() < deadline) clock.WaitUntil(mutex_, removed_, deadline);
  return calls_.size();
}

}  // namespace voxeld::daemon::services
