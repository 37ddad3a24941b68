// One Stream session: requests out, receipts in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "display/sync/clock.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::voxelctl {

// What became of this stream's commits on one display.
struct OutcomeCounts {
  uint64_t presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0;
  std::string last_lost_reason;
};

// Everything told so far.
struct StreamTally {
  uint64_t commits = 0, accepted = 0, refused = 0, unanswered = 0;
  uint64_t refused_operations = 0;
  std::map<std::string, OutcomeCounts> displays;
  uint64_t issue_count = 0;
  uint64_t not_found = 0;         // issues with REASON_NOT_FOUND
  std::vector<v1::Issue> issues;  // the first kMostIssues
};

// Send, Commit and Close are for one thread; the rest is thread-safe. A thread of its own reads.
class SceneStream {
 public:
  static constexpr size_t kMostIssues = 20;
  // Commits without their Accepted and outcomes that may be under way: more would only queue up.
  static constexpr uint64_t kMostUnanswered = 4;

  virtual ~SceneStream() = default;

  virtual const v1::Opened& opened() const = 0;

  // Sends one operation; numbers it. Blocks while the transport is full.
  virtual absl::Status Send(v1::StreamRequest request) = 0;

  // Sends a Commit. `*frame_id` (not null) becomes its number, from 1.
  virtual absl::Status Commit(uint64_t* frame_id) = 0;

  // Whether another commit may be sent now.
  virtual bool HasRoom() const = 0;

  // Each waits until `deadline` of the system's clock: DeadlineExceeded; Cancelled on an interrupt;
  // the stream's own status if it ends first.
  virtual absl::Status WaitForRoom(sync::TimeNs deadline) = 0;
  // FailedPrecondition with the server's words and the first issues if the commit was refused.
  virtual absl::Status WaitAccepted(uint64_t frame_id, sync::TimeNs deadline) = 0;
  // Until every commit has all its outcomes, an interrupt or not.
  virtual absl::Status WaitSettled(sync::TimeNs deadline) = 0;

  virtual StreamTally tally() const = 0;
  // From sending a commit to hearing that it is shown, the last 65,536 of them in no order.
  virtual std::vector<int64_t> latencies_ns() const = 0;

  // Half-closes, reads to the end, and tells how the stream ended;
  // cancels it if that takes over 5 s.
  virtual absl::Status Close() = 0;
};

// "layer/id, field: what was wrong", for people.
std::string DescribeIssue(const v1::Issue& issue);

}  // namespace voxeld::voxelctl
