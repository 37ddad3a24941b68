#include "client/cpp/src/clock_estimate.h"

#include <algorithm>

namespace voxeld::client {

void ClockEstimator::Add(int64_t sent_ns, int64_t received_ns, int64_t answered_ns,
                         int64_t heard_ns) {
  const int64_t round_trip = (heard_ns - sent_ns) - (answered_ns - received_ns);
  if (heard_ns < sent_ns || answered_ns < received_ns || round_trip < 0) return;
  // Halve each difference separately: sums of two clocks could overflow.
  samples_.push_back({(received_ns - sent_ns) / 2 + (answered_ns - heard_ns) / 2, round_trip});
  if (samples_.size() > kSamples) samples_.pop_front();
  ++count_;
}

std::optional<ClockEstimate> ClockEstimator::Get() const {
  if (samples_.empty()) return std::nullopt;
  const auto best = std::min_element(
      samples_.begin(), samples_.end(),
      [](const Sample& a, const Sample& b) { return a.round_trip_ns < b.round_trip_ns; });
  return ClockEstimate{best->offset_ns, best->round_trip_ns, count_};
}

}  // namespace voxeld::client
