// How long commits took from stage to stage.
#pragma once

#include <array>
#include <vector>

#include "display/sync/clock.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::bench {

// Of the stages in their order, each from the one before; what is not known is left out.
class StageTimes {
 public:
  static constexpr std::array kNames = {"sending",    "decoding", "applying",     "waiting",
                                        "assembling", "slicing",  "transferring", "showing"};

  // `sent_ns` by the sender's own clock, which must be the daemon's too, in place of the daemon's
  // estimate.
  void Add(sync::TimeNs sent_ns, const v1::Stages& stages);

  // In ms, in the order in which they were added.
  const std::vector<double>& of(size_t stage) const { return times_ms_[stage]; }

 private:
  std::array<std::vector<double>, kNames.size()> times_ms_;
};

}  // namespace voxeld::bench
