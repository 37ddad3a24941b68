// FramePipeline where a display's device has no brightness or no power limit of its own: the picture is dimmed.
#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/pipeline/frame_pipeline.h"

namespace voxeld::daemon {

int FramePipeline::light_steps() const {
  if (display_->brightness() == wanted_brightness_) return limiter_.steps();
  const auto steps = static_cast<int>(std::lround(limiter_.steps() * wanted_brightness_));
  // What is not asked to be dark is not.
  return std::max(steps, wanted_brightness_ > 0 && limiter_.steps() > 0 ? 1 : 0);
}

bool FramePipeline::LimitsPower() const {
  return wanted_limit_w_ > 0 && setup_.power_full_w > 0 && !display_->keeps_power_limit();
}

void FramePipeline::FollowDevice() {
  limiter_.SetLimit(LimitsPower() ? wanted_limit_w_ : 0);
  if (limiter_.limit_w() == 0) limiter_.Release();
  if (light_steps() == target_steps_) return;
  target_stale_ = settings_changed_ = true;
}

absl::Status FramePipeline::SetBrightness(double brightness) {
  const absl::Status status = display_->SetBrightness(brightness);
  if (!status.ok() && !absl::IsUnimplemented(status)) return status;
  wanted_brightness_ = brightness;
  FollowDevice();
  if (LimitsPower()) target_stale_ = settings_changed_ = true;  // to be measured anew
  return absl::OkStatus();
}

absl::Status FramePipeline::SetPowerLimit(double watts) {
  const absl::Status status = display_->SetPowerLimit(watts);
  if (absl::IsUnimplemented(status) && setup_.power_full_w == 0 && watts > 0) {
    display_->SetPowerLimit(wanted_limit_w_).IgnoreError();  // as it was
    return absl::FailedPreconditionError(absl::StrCat(
        status.message(),
        ", and what it draws is not known; give the display power_full, what it draws at "
        "full white, in watts"));
  }
  if (!status.ok() && !absl::IsUnimplemented(status)) return status;
  wanted_limit_w_ = watts;
  FollowDevice();
  // What is shown has not been measured yet.
  if (LimitsPower()) target_stale_ = settings_changed_ = true;
  return absl::OkStatus();
}

bool FramePipeline::Admit(const Drawing& drawing) {
  if (limiter_.limit_w() == 0) return true;
  // What the device dims by itself does not show in the picture.
  const double light = meter_.Measure(*drawing.lease.frame) * display_->brightness();
  if (limiter_.Admit(light, clock_.Now())) return true;
  if (genlock_ != nullptr) {
    genlock_->Failed(member_, drawing.volume, "it would draw more than the power limit");
  }
  target_stale_ = true;
  DrawAgain();
  return false;
}

void FramePipeline::AddLight(DisplayFigures& figures) const {
  figures.light = static_cast<double>(light_steps()) / kLightSteps;
  figures.power_w = limiter_.limit_w() > 0 ? limiter_.power_w() : 0;
  figures.power_unlimited =
      showing() && wanted_limit_w_ > 0 && !display_->keeps_power_limit() && !LimitsPower();
}

}  // namespace voxeld::daemon
