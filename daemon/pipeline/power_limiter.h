// A limit of power for displays whose device has none: the light of what is to be shown is added up, and turned down in
// steps.
//
// A volume that would draw too much is not shown but drawn again, a step or more darker. Light comes back only after it
// would have stayed at nine tenths of the limit for a second, so that a scene at the limit does not flicker.
//
// What a display draws is taken to grow with its light: so many watts when every pixel is at full white, nothing when all is
// dark. Single-threaded.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "display/api/slice_frame.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// Light in steps: all of it, down to none.
inline constexpr int kLightSteps = 64;

// `tone` with so many steps of its light.
display::Tone Dimmed(const display::Tone& tone, int steps);

// How much of a volume's pixels' full light is on, 0 to 1; looks only at what has changed since it last looked.
class LightMeter {
 public:
  double Measure(const display::SliceFrame& frame);

 private:
  display::FrameLayout layout_;
  uint64_t measured_ = 0;         // the newest number of a picture looked at
  std::vector<double> pictures_;  // the light of each
};

class PowerLimiter {
 public:
  // Watts at full white, above 0.
  explicit PowerLimiter(double full_w) : full_w_(full_w) {}

  // 0: none. The steps are as they were until the next volume is measured.
  void SetLimit(double limit_w) { limit_w_ = limit_w; }
  // All the light again.
  void Release() {
    steps_ = kLightSteps;
    rise_at_ = sync::kNever;
  }
  double limit_w() const { return limit_w_; }
  int steps() const { return steps_; }
  double power_w() const { return power_w_; }  // of the volume measured last

  // A volume drawn with steps() of light. False: it is too bright, and steps() says with how many it is to be
  // drawn instead.
  bool Admit(double light, sync::TimeNs now);
  // Whether steps() has grown by now: draw again. Else nothing.
  bool Rise(sync::TimeNs now);
  // When to ask at the latest.
  sync::TimeNs next() const { return rise_at_; }

 private:
  int Allowed(double share) const;

  const double full_w_;
  double limit_w_ = 0;
  double power_w_ = 0;
  int steps_ = kLightSteps;
  sync::TimeNs rise_at_ = sync::kNever;
};

}  // namespace voxeld::daemon
