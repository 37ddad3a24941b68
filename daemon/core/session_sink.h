// Where a session's answers go.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "daemon/core/receipt.h"
#include "daemon/scene/operation.h"

namespace voxeld::daemon {

// Thread-safe. Called on the core's thread or on the one that hands messages over, also with locks held; must only
// post.
class SessionSink {
 public:
  virtual ~SessionSink() = default;
  virtual void OnIssue(const Issue& issue) = 0;
  virtual void OnReceipt(const Receipt& receipt) = 0;
  // Bytes that the client may have sent in all. Never less than before.
  virtual void OnCredit(uint64_t /*total_bytes*/) {}
  // After Intake::Take filled the intake: there is room again.
  virtual void OnRoom() {}
  // The session is being ended by somebody else: an operator, a stream that took it up, the daemon's end. Nothing
  // more will be answered.
  virtual void OnEnded(const absl::Status& /*why*/) {}
  // Whether its client leaves so many answers unread that commits had better wait. Once that is over, the sink
  // says so by Intake::Wake.
  virtual bool Crowded() const { return false; }
};

}  // namespace voxeld::daemon
