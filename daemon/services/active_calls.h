// Registers open calls, so that all can be ended at shutdown.
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
  // Ends the call with `status` after writing what is queued for its client. May be called from any
  // thread and repeatedly.
  virtual void End(const absl::Status& status) = 0;

  // Set the caller before adding the call to ActiveCalls.
  void SetCaller(access::Caller caller) { caller_ = std::move(caller); }
  const access::Caller& caller() const { return caller_; }

 private:
  access::Caller caller_;
};

// Thread-safe.
class ActiveCalls {
 public:
  // Holds `call` until Remove. After EndAll it ends the call at once.
  void Add(std::shared_ptr<ActiveCall> call);
  void Remove(const ActiveCall* call);

  void EndAll(const absl::Status& status);
  // Ends each call for whose caller `check` returns an error, with that error. Returns: the number
  // of calls.
  size_t EndRevoked(const std::function<absl::Status(const access::Caller&)>& check);
  // Waits until no calls are left, or until `deadline` of `clock`. Returns: the number of remaining
  // calls.
  size_t AwaitNone(sync::Clock& clock, sync::TimeNs deadline);

 private:
  sync::Mutex mutex_;
  sync::CondVar removed_;
  std::map<const ActiveCall*, std::shared_ptr<ActiveCall>> calls_ VOXELD_GUARDED_BY(mutex_);
  std::optional<absl::Status> ended_ VOXELD_GUARDED_BY(mutex_);
};

}  // namespace voxeld::daemon::services
