#include "tools/bench/voxel_bench/stage_times.h"

namespace voxeld::bench {

void StageTimes::Add(sync::TimeNs sent_ns, const v1::Stages& stages) {
  const std::array<sync::TimeNs, kNames.size() + 1> at = {
      sent_ns,
      stages.received_ns(),
      stages.decoded_ns(),
      stages.applied_ns(),
      stages.drawing_ns(),
      stages.assembled_ns(),
      stages.sliced_ns(),
      stages.transferred_ns(),
      stages.shown_ns(),
  };
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (at[i] == 0 || at[i + 1] == 0) continue;
    times_ms_[i].push_back(static_cast<double>(at[i + 1] - at[i]) / sync::kMillisecond);
  }
}

}  // namespace voxeld::bench
