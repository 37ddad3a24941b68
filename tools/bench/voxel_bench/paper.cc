// The benchmark of the paper's tables.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/bench/paper/figures.h"
#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"

namespace voxeld::bench {
namespace {

absl::StatusOr<nlohmann::json> Measured(const PaperOptions& options, const Surroundings& with) {
  nlohmann::json report = ReportOf("paper", {{"engines", options.engines},
                                             {"tables", options.tables},
                                             {"seconds", options.seconds},
                                             {"voxels", options.voxels},
                                             {"seed", options.seed}});
  absl::StatusOr<nlohmann::json> measured =
      paper::MeasurePaper(options, with.progress, [&with] { return !with.interrupted->load(); });
  if (!measured.ok()) return measured.status();
  report.update(*measured);
  report["text"] = paper::PaperText(report);
  return report;
}

// Returns whether a row has everything that is printed.
bool IsRow(const nlohmann::json& row) {
  const auto is_number = [&](const char* key) { return row.contains(key) && row[key].is_number(); };
  return row.is_object() && row.contains("table") && row["table"].is_string() &&
         row.contains("engine") && row["engine"].is_string() && row.contains("host_copy") &&
         row["host_copy"].is_boolean() && is_number("segments") && row["segments"] > 0 &&
         is_number("voxels") && is_number("threads") && is_number("ms") && row["ms"] > 0 &&
         is_number("mvoxel_per_s");
}

absl::StatusOr<nlohmann::json> Read(const std::string& file) {
  std::ifstream in(file);
  nlohmann::json report = nlohmann::json::parse(in, nullptr, false);
  bool good = report.is_object() && report.value("benchmark", "") == "paper" &&
              report.contains("rows") && report["rows"].is_array() && report.contains("figures") &&
              report["figures"].empty() && report.contains("text") && report["text"].is_string();
  if (good) good = std::all_of(report["rows"].begin(), report["rows"].end(), IsRow);
  if (good) return report;
  return absl::InvalidArgumentError(absl::StrCat(
      file, " is no report of voxel-bench paper; `voxel-bench paper --json` prints one"));
}

}  // namespace

absl::StatusOr<nlohmann::json> RunPaper(const PaperOptions& options, const Surroundings& with) {
  absl::StatusOr<nlohmann::json> report =
      options.from.empty() ? Measured(options, with) : Read(options.from);
  if (!report.ok() || options.svg.empty()) return report;
  for (const auto& [name, svg] : paper::FiguresOf(*report)) {
    const std::string file = std::filesystem::path(options.svg) / name;
    std::ofstream out(file);
    out << svg;
    if (!out.flush()) return absl::UnavailableError(absl::StrCat(file, " could not be written"));
    with.progress(file);
  }
  return report;
}

}  // namespace voxeld::bench
