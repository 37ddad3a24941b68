// What people are told when an engine is lost and when it comes back.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace voxeld::daemon {

struct EngineEvent {
  enum class What : uint8_t {
    kLost,      // the CPU takes over
    kHolding,   // the CPU has not drawn yet: the last volume is held
    kTookOver,  // after `took_ns`
    kNotHeld,   // nothing is held any more: the display does not show
    kFaulted,   // it was tried, and faulted again
    kPinned,    // an entity is drawn by the CPU from now on
    kAway,      // it stays away for now
    kReturned,  // after `took_ns`
  };
  std::string display;
  What what = What::kLost;
  std::string why;
  int64_t took_ns = 0;
};

const char* EngineEventName(EngineEvent::What what);

}  // namespace voxeld::daemon
