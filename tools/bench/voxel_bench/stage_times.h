// How long commits took from one stage to the next.
#pragma once

#include <array>
#include <vector>

#include "display/sync/clock.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

// The stages are in order, and each is measured from the previous one; unknown stages are left out.
class StageTimes {
 public:
  static constexpr std::array kNames = {"sending",    "decoding", "applying",     "waiting",
                                        "assembling", "slicing",  "transferring", "showing"};

  // `sent_ns` is by the sender's own clock, which must also be the daemon's; it replaces the
  // daemon's estimate.
  void Add(sync::TimeNs sent_ns, const v1::Stages& stages);

  // Returns the times of a stage in ms, in the order in which they were added.
  const std::vector<double>& of(size_t stage) const { return times_ms_[stage]; }

 private:
  std::array<std::vector<double>, kNames.size()> times_ms_;
};

}  // namespace voxeld::bench
