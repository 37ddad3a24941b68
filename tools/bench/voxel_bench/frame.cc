// Whole frames, as one of the benchmarks.
#include <algorithm>
#include <utility>

#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"

namespace voxeld::bench {
namespace {

constexpr double kLatencySeconds = 5;
constexpr int kMostLatencyRounds = 5;

// The same scene by way of the daemon: from a commit's sending to the last byte in the transport, 200 times a second.
absl::StatusOr<nlohmann::json> DaemonLatency(const FrameOptions& options,
                                             const Surroundings& with) {
  LatencyOptions latency;
  latency.rounds = std::min(options.rounds, kMostLatencyRounds);
  latency.seconds = kLatencySeconds;
  latency.lines = std::max(1, static_cast<int>(10'000 * options.share));
  latency.entities = std::min(latency.entities, latency.lines);
  return RunLatency(latency, with);
}

}  // namespace

absl::StatusOr<nlohmann::json> RunFrame(const FrameOptions& options, const Surroundings& with) {
  nlohmann::json report = ReportOf("frame", {{"scene", options.scene},
                                             {"engine", options.engine},
                                             {"threads", options.threads},
                                             {"rounds", options.rounds},
                                             {"gpus", options.gpus},
                                             {"nccl", options.nccl},
                                             {"keep_tiles", options.keep_tiles},
                                             {"seed", options.seed},
                                             {"share", options.share}});
  absl::StatusOr<nlohmann::json> measured =
      frame::MeasureFrames(options, with.progress, [&with] { return !with.interrupted->load(); });
  if (!measured.ok()) return measured.status();
  report.update(*measured);
  report["text"] = frame::FrameText(report);
  if (options.scene == "rgb3" && options.engine == "cpu") {
    const absl::StatusOr<nlohmann::json> latency = DaemonLatency(options, with);
    if (!latency.ok()) return latency.status();
    report["figures"] = (*latency)["figures"];
    report["latency_options"] = (*latency)["options"];
  }
  return report;
}

}  // namespace voxeld::bench
