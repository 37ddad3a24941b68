// The outcome of a volume, and the state of a display.
#pragma once

#include <cstdint>
#include <string>

namespace voxeld::display {

// How a time of presentation was determined.
enum class Evidence : uint8_t {
  kDevice,     // the device reported that it showed the volume
  kEstimated,  // computed from when the bytes were handed over
};

// Exactly one for each volume given to Display::Submit.
struct VolumeOutcome {
  enum class Kind : uint8_t {
    kPresented,  // shown completely, at time_ns
    kReplaced,   // a newer volume replaced it in the mailbox before it was sent
    kLost,       // sending or showing failed, for `reason`
  };
  Kind kind = Kind::kLost;
  uint64_t volume = 0;
  // on the display's clock: when it was presented, or when the outcome was decided
  int64_t time_ns = 0;
  Evidence evidence = Evidence::kEstimated;
  uint64_t replaced_by = 0;  // kReplaced: the newer volume
  int64_t last_byte_ns = 0;  // when the transport took the last byte; 0 if it did not
  uint64_t bytes_sent = 0;   // on the wire for this volume, including re-sent slices
  std::string reason;        // kLost: what failed
};

enum class DisplayState : uint8_t {
  kStopped,    // not started, or stopped
  kAttaching,  // looking for the device, or setting it up
  kShowing,    // volumes are sent
  kBlanked,    // attached, dark on request; volumes are refused
  kLost,       // the device is gone or failed; it is attached again automatically
};

const char* DisplayStateName(DisplayState state);

}  // namespace voxeld::display
