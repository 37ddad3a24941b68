// Calls that are open. At shutdown each is told to end.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "daemon/access/access.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::services {

class ActiveCall {
 public:
  virtual ~ActiveCall() = default;
  // Ends the call with `status` once what is queued for its client has been written. May be called
  // from any thread, and more than once.
  virtual void End(const absl::Status& status) = 0;

  // Whose it is; set before it is among others.
  void SetCaller(access::Caller caller) { caller_ = std::move(caller); }
  const access::Caller& caller() const { return caller_; }

 private:
  access::Caller caller_;
};

// Thread-safe.
class ActiveCalls {
 public:
  // `call` is kept until Remove. After EndAll it is told to end at once.
  void Add(std::shared_ptr<ActiveCall> call);
  void Remove(const ActiveCall* call);

  void EndAll(const absl::Status& status);
  // Ends those of whose callers `check` says something else than OK, with that. Answers how many.
  size_t EndRevoked(const std::function<absl::Status(const access::Caller&)>& check);
  // Until none is left, or `deadline` of `clock`. Answers how many are.
  size_t AwaitNone(sync::Clock& clock, sync::TimeNs deadline);

 private:
  sync::Mutex mutex_;
  sync::CondVar removed_;
  std::map<const ActiveCall*, std::shared_ptr<ActiveCall>> calls_ VOXELD_GUARDED_BY(mutex_);
  std::optional<absl::Status> ended_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::services
