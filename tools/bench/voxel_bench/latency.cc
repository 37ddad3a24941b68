// Measures the time from sending a commit to its last byte in the transport, for a client that
// commits steadily.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/bench/voxel_bench/paced_client.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"
#include "tools/bench/voxel_bench/servers.h"

namespace voxeld::bench {
namespace {

constexpr double kDisplayVoxels = 64;  // of the displays in the default options
constexpr int kVariants = 16;
constexpr double kWarmSeconds = 0.5;

}  // namespace

absl::StatusOr<nlohmann::json> RunLatency(const LatencyOptions& options, const Surroundings& with) {
  nlohmann::json report = ReportOf("latency", {{"rounds", options.rounds},
                                               {"seconds", options.seconds},
                                               {"commits_per_s", options.rate},
                                               {"lines", options.lines},
                                               {"entities", options.entities},
                                               {"voxels_a_line", options.voxels},
                                               {"display", options.display}});
  absl::StatusOr<std::unique_ptr<ServerProcess>> daemon = ServerProcess::StartDaemon(
      {.program = with.daemon, .displays = {absl::StrCat("sim=simulated,", options.display)}});
  if (!daemon.ok()) return daemon.status();
  Loop loop(with.interrupted);
  absl::StatusOr<std::unique_ptr<PacedClient>> client =
      PacedClient::Open(loop, (*daemon)->unix_target(),
                        LineFrames("lines", options.lines, options.entities, options.voxels,
                                   kDisplayVoxels, kVariants));
  if (!client.ok()) return client.status();

  const auto duration = [](double seconds) {
    return static_cast<sync::TimeNs>(seconds * sync::kSecond);
  };
  const absl::StatusOr<PacedRun> warm =
      (*client)->Run(duration(std::min(kWarmSeconds, options.seconds)), options.rate);
  if (!warm.ok()) return warm.status();

  std::vector<double> p50, p99, worst, late_p99, superseded, presented;
  std::vector<std::vector<double>> stages(StageTimes::kNames.size());
  Tally sum;
  for (int i = 0; i < options.rounds; ++i) {
    const absl::StatusOr<PacedRun> run = (*client)->Run(duration(options.seconds), options.rate);
    if (!run.ok()) return run.status();
    const double owed = std::max<double>(1, static_cast<double>(run->tally.owed));
    superseded.push_back(static_cast<double>(run->tally.superseded) / owed);
    presented.push_back(static_cast<double>(run->tally.presented) / owed);
    late_p99.push_back(QuantileOf(run->late_ms, 0.99));
    if (!run->latency_ms.empty()) {
      p50.push_back(QuantileOf(run->latency_ms, 0.5));
      p99.push_back(QuantileOf(run->latency_ms, 0.99));
      worst.push_back(QuantileOf(run->latency_ms, 1));
    }
    for (size_t stage = 0; stage < stages.size(); ++stage) {
      const std::vector<double>& times = run->stages.of(stage);
      if (!times.empty()) stages[stage].push_back(SpreadOf(times).median);
    }
    sum += run->tally;
    with.progress(absl::StrFormat("latency: p50 %.3f ms, p99 %.3f ms, %d of %d presented",
                                  p50.empty() ? 0 : p50.back(), p99.empty() ? 0 : p99.back(),
                                  run->tally.presented, run->tally.owed));
  }
  AddFigure(report, "commit_to_last_byte.p50", "ms", SpreadOf(p50));
  AddFigure(report, "commit_to_last_byte.p99", "ms", SpreadOf(p99));
  AddFigure(report, "commit_to_last_byte.max", "ms", SpreadOf(worst));
  AddFigure(report, "presented", "of all outcomes", SpreadOf(presented));
  AddFigure(report, "superseded", "of all outcomes", SpreadOf(superseded));
  AddFigure(report, "sent_late.p99", "ms", SpreadOf(late_p99));
  for (size_t stage = 0; stage < stages.size(); ++stage) {
    if (stages[stage].empty()) continue;  // the daemon does not report it
    AddFigure(report, absl::StrCat("stage.", StageTimes::kNames[stage], ".p50"), "ms",
              SpreadOf(stages[stage]));
  }
  report["commits"] = ToJson(sum);
  return report;
}

}  // namespace voxeld::bench
