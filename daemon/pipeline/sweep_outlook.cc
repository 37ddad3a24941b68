#include "daemon/pipeline/sweep_outlook.h"

#include <algorithm>

namespace voxeld::daemon {
namespace {

// Predictions are as good as the device's last word; a sweep has surely begun this much later.
constexpr sync::TimeNs kMargin = sync::kMillisecond;

}  // namespace

void SweepOutlook::Set(const std::vector<sync::TimeNs>& coming) {
  sync::MutexLock lock(mutex_);
  sweeps_.reset();
  if (coming.size() >= 2 && coming[1] > coming[0]) {
    sweeps_ = {coming[0], coming[1] - coming[0]};
  }
}

sync::TimeNs SweepOutlook::DueTime(sync::TimeNs present_at) const {
  sync::MutexLock lock(mutex_);
  if (!sweeps_.has_value()) return present_at;
  const auto [next, period] = *sweeps_;
  const sync::TimeNs ahead = present_at - next;
  // The quotient rounded up, of either sign.
  const sync::TimeNs sweeps = ahead / period + (ahead % period > 0 ? 1 : 0);
  return next + (sweeps - 1) * period + std::min(kMargin, period / 8);
}

}  // namespace voxeld::daemon
