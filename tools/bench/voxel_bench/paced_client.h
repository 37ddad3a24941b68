// A client that commits at a steady rate, and measures how long its commits take to reach the
// display.
//
// Bound to its loop's thread.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/bench/voxel_bench/feed.h"
#include "tools/bench/voxel_bench/session.h"
#include "tools/bench/voxel_bench/stage_times.h"
#include "tools/bench/voxel_bench/wire.h"

namespace voxeld::bench {

struct PacedRun {
  Tally tally;                     // of this run only, settled
  std::vector<double> latency_ms;  // of presented commits: first byte sent → last byte out
  std::vector<double> late_ms;     // of each commit: when due → first byte sent
  StageTimes stages;
};

class PacedClient {
 public:
  // Opens a session, which stays open as long as the object exists. `frames` are sent cyclically.
  static absl::StatusOr<std::unique_ptr<PacedClient>> Open(Loop& loop, const std::string& target,
                                                           Frames frames);

  // Commits for `duration`, then waits for the outcomes.
  absl::StatusOr<PacedRun> Run(sync::TimeNs duration, double rate);

 private:
  PacedClient(Loop& loop, const std::string& target, Frames frames);
  void OnReceipt(const v1::Receipt& receipt);

  Loop& loop_;
  Connection connection_;
  Session session_;
  FrameSender sender_;
  PacedRun run_;
};

// Returns frames of one batch each, whose `entities` together have `lines` lines of `voxels` voxels
// on a display that is `size_voxels` wide; every line differs between the frames.
Frames LineFrames(const std::string& layer, int lines, int entities, double voxels,
                  double size_voxels, int variants);

}  // namespace voxeld::bench
