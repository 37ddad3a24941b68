// Estimates the server's clock from round trips, as NTP does: the fastest of the last ones is used.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "voxeld/client.h"

namespace voxeld::client {

class ClockEstimator {
 public:
  static constexpr size_t kSamples = 16;

  // Adds one round trip: sent and heard by the client's clock, received and answered by the
  // server's. Impossible ones (heard before sent, …) are ignored.
  void Add(int64_t sent_ns, int64_t received_ns, int64_t answered_ns, int64_t heard_ns);
  std::optional<ClockEstimate> Get() const;
  // Call when connected to another server, which has another clock.
  void Reset() { *this = ClockEstimator(); }

 private:
  struct Sample {
    int64_t offset_ns, round_trip_ns;
  };
  std::deque<Sample> samples_;
  uint64_t count_ = 0;
};

}  // namespace voxeld::client
