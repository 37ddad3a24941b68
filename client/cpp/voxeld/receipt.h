// What the server tells: the answers to commits, what became of each on every display, what was
// refused, and the sums.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld::client {

enum class Reason : uint8_t {
  kUnspecified,
  kInvalidValue,
  kSizeMismatch,
  kIndexOutOfRange,
  kQuotaExceeded,
  kNotFound,
  kAlreadyExists,
  kInUse,
  kCycle,
  kSingularTransform,
  kOutOfRange,
  kStaleSequence,
  kOutOfOrder,
  kPermissionDenied,
  kUnimplemented,
  kTimedOut,
};

// As the wire has it: "REASON_INVALID_VALUE".
std::string_view ReasonName(Reason reason);

// One refused operation. Its entity stays as it was; the session goes on.
struct Issue {
  uint64_t frame = 0;     // the commit that it was of; 0: not known
  uint64_t sequence = 0;  // of the request on the wire
  std::string layer, id;
  std::string field;  // path within the request
  Reason reason = Reason::kUnspecified;
  std::string message;   // what was wrong, the value, what would be right
  bool applied = false;  // it was carried out all the same, otherwise than asked
};

// When a commit passed what, in ns of the server's monotonic clock; 0: not known.
struct Stages {
  int64_t sent_ns = 0;  // the client's own time, in the server's clock
  int64_t received_ns = 0;
  int64_t decoded_ns = 0;
  int64_t applied_ns = 0;
  int64_t drawing_ns = 0;
  int64_t assembled_ns = 0;
  int64_t sliced_ns = 0;
  int64_t transferred_ns = 0;
  int64_t shown_ns = 0;
};

// What became of a commit on one display.
struct Outcome {
  enum class Kind : uint8_t { kPresented, kUnchanged, kSuperseded, kLost, kNotShown };
  std::string display;
  Kind kind = Kind::kLost;
  uint64_t volume = 0;       // presented, or that which is shown unchanged
  int64_t time_ns = 0;       // presented: when, by the server's clock
  bool measured = false;     // presented: the device said so; else it is estimated
  int64_t last_byte_ns = 0;  // presented: when the transport had taken the last byte
  Stages stages;             // presented
  uint64_t by_frame = 0;     // superseded: by this commit
  std::string reason;        // lost, not shown
  int64_t latency_ns = 0;    // from sending the commit to hearing this, by the client's clock
};

// All that is known of one commit.
struct Receipt {
  enum class State : uint8_t {
    kQueued,     // waits here
    kSent,       // no answer yet
    kScheduled,  // the server keeps it for its time
    kAccepted,
    kRefused,  // by the server; or here, because it would take more than the server reads
    kDropped,  // all that it held were frames that the flow policy gave up; it was not sent
    kLost,  // no answer to it will come; `message` says why, and whether it may have been applied
  };
  uint64_t frame = 0;
  State state = State::kQueued;
  std::string message;  // refused, lost: why
  uint64_t snapshot = 0;
  uint64_t refused_operations = 0;
  int64_t applied_time_ns = 0;
  int64_t present_at_ns = 0;           // scheduled: when
  bool late = false;                   // a timed commit that was due before it came
  uint64_t dropped_frames = 0;         // of it, by the server
  uint64_t client_dropped_frames = 0;  // of it, here
  uint64_t sendings = 0;               // more than 1: it was sent again after a disconnect
  Stages stages;                       // up to applied_ns
  std::vector<std::string> displays;   // those that owe an outcome
  std::vector<Outcome> outcomes;       // those that came
  std::vector<Issue> issues;           // the first 100
  bool durable_owed = false;           // the server will say when it is on its disk
  bool durable = false;                // it has
  bool settled = false;                // no more is owed
};

// What became of a session's commits on one display.
struct OutcomeCounts {
  uint64_t presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0;
  std::string last_lost_reason;
};

// Everything so far, over all connections.
struct Tally {
  uint64_t commits = 0;  // asked for
  uint64_t accepted = 0, refused = 0, dropped = 0, lost = 0;
  uint64_t unsettled = 0;  // neither refused, dropped nor lost, nor accepted with all outcomes
  uint64_t refused_operations = 0;
  uint64_t client_dropped_frames = 0;                   // immediate frames that were given up here
  uint64_t server_dropped_frames = 0;                   // and there
  uint64_t connections = 0, resumed = 0, restored = 0;  // opened; taken up again; sent again
  uint64_t bytes_sent = 0, messages_sent = 0;
  uint64_t memory_bytes = 0;  // handed over in sealed memory, beside bytes_sent
  std::map<std::string, OutcomeCounts> displays;
  uint64_t issue_count = 0, not_found = 0;  // issues; those with Reason::kNotFound
  uint64_t untold_issues = 0;               // that on_issue was not called for, being too slow
  std::vector<Issue> issues;                // the first 20
};

}  // namespace voxeld::client
