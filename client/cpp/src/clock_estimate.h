// The server's clock from round trips, as NTP does it: of the last ones the fastest counts.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "voxeld/client.h"

namespace voxeld::client {

class ClockEstimator {
 public:
  static constexpr size_t kSamples = 16;

  // One round trip: sent and heard by the client's clock, received and answered by the server's.
  // One that cannot be (heard before it was sent, …) is ignored.
  void Add(int64_t sent_ns, int64_t received_ns, int64_t answered_ns, int64_t heard_ns);
  std::optional<ClockEstimate> Get() const;
  // Another server, another clock.
  void Reset() { *this = ClockEstimator(); }

 private:
  struct Sample {
    int64_t offset_ns, round_trip_ns;
  };
  std::deque<Sample> samples_;
  uint64_t count_ = 0;
};

}  // namespace voxeld::client
