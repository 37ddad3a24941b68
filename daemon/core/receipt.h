// What a session is told of its commits.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "display/api/outcome.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// When a commit passed what, by the core's clock; 0: not known.
struct Stages {
  sync::TimeNs sent_ns = 0;  // by the client's word, in the core's clock as well as is known
  sync::TimeNs received_ns = 0, decoded_ns = 0, applied_ns = 0;
  sync::TimeNs drawing_ns = 0, assembled_ns = 0, sliced_ns = 0, transferred_ns = 0, shown_ns = 0;
};

struct Accepted {
  uint64_t snapshot = 0;
  uint64_t refused_operations = 0;
  sync::TimeNs applied_time_ns = 0;
  std::vector<std::string> displays;  // each gives exactly one outcome
  bool late = false;                  // its present_at had passed when it came
  uint64_t dropped_frames = 0;        // of its own, given up by the session's FlowPolicy
  bool durable = false;               // Durable comes as well
  Stages stages;                      // up to applied_ns
};

// A timed commit waits.
struct Scheduled {
  sync::TimeNs present_at_ns = 0;
};

// What the commit made is on the disk, as part of this snapshot or a later one.
struct Durable {
  uint64_t snapshot = 0;
};

struct Refused {
  uint64_t refused_operations = 0;
  std::string message;
};

// What became of a commit on one display.
struct CommitOutcome {
  enum class Kind : uint8_t { kPresented, kUnchanged, kSuperseded, kLost, kNotShown };
  enum class NotShown : uint8_t { kAbsent, kRemoved, kBlanked, kHidden };
  std::string display;
  Kind kind = Kind::kLost;
  uint64_t volume = 0;       // presented, unchanged
  sync::TimeNs time_ns = 0;  // presented
  display::Evidence evidence = display::Evidence::kEstimated;
  sync::TimeNs last_byte_ns = 0;  // presented
  Stages stages;                  // presented
  uint64_t by_frame_id = 0;       // superseded
  uint64_t by_sequence = 0;       // superseded
  std::string reason;             // lost
  NotShown why = NotShown::kAbsent;
};

struct Receipt {
  uint64_t frame_id = 0;
  uint64_t sequence = 0;
  std::variant<Accepted, Refused, CommitOutcome, Scheduled, Durable> what;
  uint64_t incarnation = 0;  // of the session that sent the commit
};

// What comes after the answer to a commit, also to a stream that takes its session up.
inline bool IsOwed(const Receipt& receipt) {
  return std::holds_alternative<CommitOutcome>(receipt.what) ||
         std::holds_alternative<Durable>(receipt.what);
}

}  // namespace voxeld::daemon
