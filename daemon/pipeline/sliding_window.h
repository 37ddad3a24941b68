// Figures over the recent past: quantiles of the last 10 s (at most the last 4096 values), events a
// second over the last 2 s. Single-threaded.
#pragma once

#include <cstdint>
#include <deque>
#include <utility>

#include "daemon/core/stats.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

class SlidingLatency {
 public:
  static constexpr sync::TimeNs kSpan = 10 * sync::kSecond;
  static constexpr size_t kMost = 4096;

  // `now` never goes back.
  void Add(sync::TimeNs now, int64_t value_ns);
  // Quantile q is the value of rank ⌈q·count⌉.
  LatencyStats Summary(sync::TimeNs now) const;

 private:
  std::deque<std::pair<sync::TimeNs, int64_t>> values_;
};

class SlidingRate {
 public:
  static constexpr sync::TimeNs kSpan = 2 * sync::kSecond;

  void Add(sync::TimeNs now);
  double PerSecond(sync::TimeNs now) const;

 private:
  std::deque<sync::TimeNs> times_;
};

}  // namespace voxeld::daemon
