// A client that commits at a steady rate, and how long its commits take to get out to the display.
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
  Tally tally;                     // of this run alone; settled
  std::vector<double> latency_ms;  // of what was presented: first byte sent → last byte out
  std::vector<double> late_ms;     // of each commit: when it was due → first byte sent
  StageTimes stages;
};

class PacedClient {
 public:
  // Whoever holds it keeps a session open. `frames`: what goes out, in turns.
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

// Frames of one batch each, with `entities` that together have `lines` lines of `voxels` voxels on
// a display that is `size_voxels` wide; every line is another in each of them.
Frames LineFrames(const std::string& layer, int lines, int entities, double voxels,
                  double size_voxels, int variants);

}  // namespace voxeld::bench
