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
  const auto slices = static_cast<size_t>(layout.slices);
  const auto subs = static_cast<size_t>(layout.sub_frames);
  if (layout != layout_) {
    layout_ = layout;
    slices_.assign(slices, 0);
    measured_ = 0;
  }
  const size_t size = layout.bytes_per_slice();
  std::vector<uint8_t> rgb(static_cast<size_t>(layout.width) * static_cast<size_t>(layout.height) *
                           3);
  uint64_t newest = measured_;
  std::vector<std::span<const std::byte>> pictures(subs);
  for (size_t slice = 0; slice < slices; ++slice) {
    bool changed = false;
    for (size_t sub = 0; sub < subs; ++sub) {
      const size_t picture = slice * subs + sub;
      changed = changed || frame.changed_in[picture] > measured_;
      newest = std::max(newest, frame.changed_in[picture]);
      pictures[sub] = std::span(frame.bytes).subspan(picture * size, size);
    }
    if (!changed) continue;
    display::SliceToRgb(layout, pictures, rgb);
    const auto sum = std::accumulate(rgb.begin(), rgb.end(), uint64_t{0});
    slices_[slice] = static_cast<double>(sum) / (255.0 * static_cast<double>(rgb.size()));
  }
  measured_ = newest;
  return std::accumulate(slices_.begin(), slices_.end(), 0.0) / static_cast<double>(slices);
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
