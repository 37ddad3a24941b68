// What became of a volume, and what state a display is in. Words only.
#pragma once

#include <cstdint>
#include <string>

namespace voxeld::display {

// How a time of presentation is known.
enum class Evidence : uint8_t {
  kDevice,     // the device reported that it showed the volume
  kEstimated,  // computed from when the bytes were handed over
};

// Exactly one for each volume given to Display::Submit.
struct VolumeOutcome {
  enum class Kind : uint8_t {
    kPresented,  // shown whole, at time_ns
    kReplaced,   // a newer volume took its place in the mailbox before it was sent
    kLost,       // sending or showing failed, for `reason`
  };
  Kind kind = Kind::kLost;
  uint64_t volume = 0;
  int64_t time_ns = 0;  // on the display's clock; of presentation, or of the verdict
  Evidence evidence = Evidence::kEstimated;
  uint64_t replaced_by = 0;  // kReplaced: the newer volume
  int64_t last_byte_ns = 0;  // when the transport took the last byte; 0 if it did not
  uint64_t bytes_sent = 0;   // on the wire for this volume, re-sent slices included
  std::string reason;        // kLost: what failed
};

enum class DisplayState : uint8_t {
  kStopped,    // not started, or stopped
  kAttaching,  // looking for the device, or setting it up
  kShowing,    // volumes go out
  kBlanked,    // attached, dark on request; volumes are refused
  kLost,       // the device is gone or failed; attaching again by itself
};

const char* DisplayStateName(DisplayState state);

}  // namespace voxeld::display
