// Calls DisplayService.WatchStats and reads its responses as they come, or not at all.
//
// Bound to its loop's thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "absl/status/statusor.h"
#include "tools/bench/voxel_bench/wire.h"
#include "voxeld/v1/display.pb.h"

namespace voxeld::bench {

class StatsWatch {
 public:
  // `stats` is called with each response. If `read_on` is false, only the first is read, then one
  // for each Read().
  StatsWatch(Loop& loop, const Connection& connection, sync::TimeNs interval,
             std::function<void(const v1::Stats&)> stats, bool read_on = true);

  void Read() { call_.Read(); }
  bool ended() const { return call_.ended(); }

 private:
  const std::function<void(const v1::Stats&)> stats_;
  const Message request_;
  bool asked_ = false;
  Call call_;
};

// Returns the current statistics.
absl::StatusOr<v1::Stats> StatsOf(Loop& loop, const Connection& connection);

}  // namespace voxeld::bench
