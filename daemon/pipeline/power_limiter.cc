#include "daemon/pipeline/power_limiter.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "display/api/pixels.h"

namespace voxeld::daemon {
namespace {

constexpr double kComfort = 0.9;  // of the limit, to which light comes back
constexpr sync::TimeNs kPatience = sync::kSecond;

}  // namespace

display::Tone Dimmed(const display::Tone& tone, int steps) {
  display::Tone dimmed = tone;
  for (display::Tone::Curve& curve : dimmed.lut) {
    for (uint16_t& light : curve) {
      light = static_cast<uint16_t>((light * steps + kLightSteps / 2) / kLightSteps);
    }
  }
  return dimmed;
}

double LightMeter::Measure(const display::SliceFrame& frame) {
  const display::FrameLayout& layout = frame.layout;
  if (layout != layout_) {
    layout_ = layout;
    pictures_.assign(layout.pictures(), 0);
    measured_ = 0;
  }
  const size_t size = layout.bytes_per_slice();
  uint64_t newest = measured_;
  for (size_t picture = 0; picture < pictures_.size(); ++picture) {
    if (frame.changed_in[picture] <= measured_) continue;
    newest = std::max(newest, frame.changed_in[picture]);
    pictures_[picture] =
        display::LightOf(layout, std::span(frame.bytes).subspan(picture * size, size));
  }
  measured_ = newest;
  return std::accumulate(pictures_.begin(), pictures_.end(), 0.0) /
         static_cast<double>(pictures_.size());
}

int PowerLimiter::Allowed(double share) const {
  if (limit_w_ == 0 || power_w_ <= 0) return kLightSteps;
  const double steps = std::floor(steps_ * share * limit_w_ / power_w_);
  return static_cast<int>(std::clamp(steps, 0.0, double{kLightSteps}));
}

bool PowerLimiter::Admit(double light, sync::TimeNs now) {
  power_w_ = light * full_w_;
  if (limit_w_ > 0 && power_w_ > limit_w_ && steps_ > 0) {
    steps_ = std::min(steps_ - 1, Allowed(1));
    rise_at_ = sync::kNever;
    return false;
  }
  // Nothing was measured while there is no light at all: try a step.
  const int allowed = steps_ == 0 ? 1 : Allowed(kComfort);
  if (steps_ == kLightSteps || allowed <= steps_) {
    rise_at_ = sync::kNever;
  } else if (rise_at_ == sync::kNever) {
    rise_at_ = now + kPatience;
  }
  return true;
}

bool PowerLimiter::Rise(sync::TimeNs now) {
  if (now < rise_at_) return false;
  rise_at_ = sync::kNever;
  const int allowed = steps_ == 0 ? 1 : Allowed(kComfort);
  if (allowed <= steps_) return false;
  steps_ = allowed;
  return true;
}

}  // namespace voxeld::daemon
