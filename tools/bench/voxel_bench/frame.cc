// The benchmark of whole frames.
#include <algorithm>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tools/bench/frame/resolution_figure.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"

namespace voxeld::bench {
namespace {

constexpr double kLatencySeconds = 5;
constexpr int kMostLatencyRounds = 5;

// Measures the same scene through the daemon: from sending a commit to the last byte in the
// transport, 200 times a second.
absl::StatusOr<nlohmann::json> DaemonLatency(const FrameOptions& options,
                                             const Surroundings& with) {
  LatencyOptions latency;
  latency.rounds = std::min(options.rounds, kMostLatencyRounds);
  latency.seconds = kLatencySeconds;
  latency.lines = std::max(1, static_cast<int>(10'000 * options.share));
  latency.entities = std::min(latency.entities, latency.lines);
  return RunLatency(latency, with);
}

absl::StatusOr<nlohmann::json> Measured(const FrameOptions& options, const Surroundings& with) {
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

// Returns whether a row that is read from a file has everything that the text and the figure use.
bool IsRow(const nlohmann::json& row) {
  const auto is_string = [&](const char* key) { return row.contains(key) && row[key].is_string(); };
  return row.is_object() && is_string("scene") && is_string("engine") && is_string("device") &&
         row.contains("threads") && row["threads"].is_number() && row.contains("grid") &&
         row["grid"].is_array() && row["grid"].size() == 3 && row["grid"][0].is_number() &&
         row["grid"][0] > 0 && row.contains("device_ms") && row["device_ms"].is_object() &&
         row["device_ms"].contains("median") && row["device_ms"]["median"].is_number() &&
         row["device_ms"]["median"] > 0;
}

// Returns all rows of several reports.
absl::StatusOr<nlohmann::json> Read(const std::vector<std::string>& files) {
  nlohmann::json report = ReportOf("frame", {{"from", files}});
  report["rows"] = nlohmann::json::array();
  std::string text;
  for (const std::string& file : files) {
    std::ifstream in(file);
    const nlohmann::json one = nlohmann::json::parse(in, nullptr, false);
    bool good = one.is_object() && one.value("benchmark", "") == "frame" && one.contains("rows") &&
                one["rows"].is_array() && one.contains("text") && one["text"].is_string();
    if (good) good = std::all_of(one["rows"].begin(), one["rows"].end(), IsRow);
    if (!good) {
      return absl::InvalidArgumentError(absl::StrCat(
          file, " is no report of voxel-bench frame; `voxel-bench frame --json` prints one"));
    }
    text += one["text"];
    for (const nlohmann::json& row : one["rows"]) report["rows"].push_back(row);
  }
  report["text"] = text;
  return report;
}

}  // namespace

absl::StatusOr<nlohmann::json> RunFrame(const FrameOptions& options, const Surroundings& with) {
  absl::StatusOr<nlohmann::json> report =
      options.from.empty() ? Measured(options, with) : Read(options.from);
  if (!report.ok() || options.svg.empty()) return report;
  const std::string svg = frame::ResolutionSvg((*report)["rows"]);
  if (svg.empty()) {
    return absl::InvalidArgumentError("no report has the scene implicit, which --svg draws");
  }
  std::ofstream out(options.svg);
  out << svg;
  if (!out.flush())
    return absl::UnavailableError(absl::StrCat(options.svg, " could not be written"));
  with.progress(options.svg);
  return report;
}

}  // namespace voxeld::bench
