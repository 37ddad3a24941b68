// The server's reports: the answers to commits, the outcome of each on every display, the issues,
// and the totals.
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

// Returns the name on the wire, such as "REASON_INVALID_VALUE".
std::string_view ReasonName(Reason reason);

// A refused operation. Its entity stays as it was; the session continues.
struct Issue {
  uint64_t frame = 0;     // the commit that it belongs to; 0: unknown
  uint64_t sequence = 0;  // of the request on the wire
  std::string layer, id;
  std::string field;  // path within the request
  Reason reason = Reason::kUnspecified;
  std::string message;   // what was wrong, the value, and what is expected
  bool applied = false;  // it was carried out nevertheless, but in another way than requested
};

// When a commit passed each stage, in ns of the server's monotonic clock; 0: unknown.
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

// The outcome of a commit on one display.
struct Outcome {
  enum class Kind : uint8_t { kPresented, kUnchanged, kSuperseded, kLost, kNotShown };
  std::string display;
  Kind kind = Kind::kLost;
  uint64_t volume = 0;       // the volume presented, or the one that is still shown unchanged
  int64_t time_ns = 0;       // presented: when, by the server's clock
  bool measured = false;     // presented: the device said so; else it is estimated
  int64_t last_byte_ns = 0;  // presented: when the transport had taken the last byte
  Stages stages;             // presented
  uint64_t by_frame = 0;     // superseded: by this commit
  std::string reason;        // lost, not shown
  int64_t latency_ns = 0;    // from sending the commit to learning this, by the client's clock
};

// Everything that is known of one commit.
struct Receipt {
  enum class State : uint8_t {
    kQueued,     // waits here
    kSent,       // not answered yet
    kScheduled,  // the server holds it until its present_at
    kAccepted,
    kRefused,  // by the server; or here, because it exceeds the server's message size
    kDropped,  // it held only frames, and the flow policy dropped them all; it was not sent
    kLost,     // no answer will come; `message` says why, and whether it may have been applied
  };
  uint64_t frame = 0;
  State state = State::kQueued;
  std::string message;  // refused, lost: why
  uint64_t snapshot = 0;
  uint64_t refused_operations = 0;
  int64_t applied_time_ns = 0;
  int64_t present_at_ns = 0;           // scheduled: when
  bool late = false;                   // a timed commit that arrived after it was due
  uint64_t dropped_frames = 0;         // dropped by the server
  uint64_t client_dropped_frames = 0;  // dropped by the client
  uint64_t sendings = 0;               // more than 1: it was sent again after a disconnect
  Stages stages;                       // up to applied_ns
  std::vector<std::string> displays;   // displays whose outcome is pending
  std::vector<Outcome> outcomes;       // outcomes received
  std::vector<Issue> issues;           // the first 100
  bool durable_owed = false;           // the server will report when it is on its disk
  bool durable = false;                // the server has reported that
  bool settled = false;                // no more answers are pending
};

// The outcomes of a session's commits on one display.
struct OutcomeCounts {
  uint64_t presented = 0, unchanged = 0, superseded = 0, lost = 0, not_shown = 0;
  std::string last_lost_reason;
};

// Totals since the session began, over all connections.
struct Tally {
  uint64_t commits = 0;  // requested
  uint64_t accepted = 0, refused = 0, dropped = 0, lost = 0;
  uint64_t unsettled = 0;  // neither refused, dropped nor lost, nor accepted with all outcomes
  uint64_t refused_operations = 0;
  uint64_t client_dropped_frames = 0;  // immediate frames dropped by the client
  uint64_t server_dropped_frames = 0;  // immediate frames dropped by the server
  // connections opened; sessions resumed; states sent again
  uint64_t connections = 0, resumed = 0, restored = 0;
  uint64_t bytes_sent = 0, messages_sent = 0;
  uint64_t memory_bytes = 0;  // handed over in sealed memory, not part of bytes_sent
  std::map<std::string, OutcomeCounts> displays;
  uint64_t issue_count = 0, not_found = 0;  // issues; those with Reason::kNotFound
  // issues for which on_issue was not called, because it was too slow
  uint64_t untold_issues = 0;
  std::vector<Issue> issues;  // the first 20
};

}  // namespace voxeld::client
