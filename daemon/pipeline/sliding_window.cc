#include "daemon/pipeline/sliding_window.h"

#include <algorithm>
#include <vector>

namespace voxeld::daemon {

void SlidingLatency::Add(sync::TimeNs now, int64_t value_ns) {
  values_.emplace_back(now, value_ns);
  while (values_.size() > kMost || values_.front().first <= now - kSpan) values_.pop_front();
}

LatencyStats SlidingLatency::Summary(sync::TimeNs now) const {
  std::vector<int64_t> values;
  for (const auto& [time, value] : values_) {
    if (time > now - kSpan) values.push_back(value);
  }
  LatencyStats stats;
  if (values.empty()) return stats;
  std::sort(values.begin(), values.end());
  const auto quantile = [&](size_t percent) {
    return values[(values.size() * percent + 99) / 100 - 1];
  };
  stats.count = values.size();
  stats.p50_ns = quantile(50);
  stats.p99_ns = quantile(99);
  stats.max_ns = values.back();
  return stats;
}

void SlidingRate::Add(sync::TimeNs now) {
  times_.push_back(now);
  while (times_.front() <= now - kSpan) times_.pop_front();
}

double SlidingRate::PerSecond(sync::TimeNs now) const {
  const auto recent = std::count_if(times_.begin(), times_.end(),
                                    [now](sync::TimeNs time) { return time > now - kSpan; });
  return static_cast<double>(recent) * static_cast<double>(sync::kSecond) /
         static_cast<double>(kSpan);
}

}  // namespace voxeld::daemon
