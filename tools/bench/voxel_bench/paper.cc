// The paper's tables, as one of the benchmarks.
#include <utility>

#include "tools/bench/voxel_bench/report.h"
#include "tools/bench/voxel_bench/run.h"

namespace voxeld::bench {

absl::StatusOr<nlohmann::json> RunPaper(const PaperOptions& options, const Surroundings& with) {
  nlohmann::json report = ReportOf("paper", {{"engines", options.engines},
                                             {"tables", options.tables},
                                             {"seconds", options.seconds},
                                             {"voxels", options.voxels},
                                             {"seed", options.seed}});
  absl::StatusOr<nlohmann::json> measured =
      paper::MeasurePaper(options, with.progress, [&with] { return !with.interrupted->load(); });
  if (!measured.ok()) return measured.status();
  report["text"] = paper::PaperText(*measured);
  report.update(*measured);
  return report;
}

}  // namespace voxeld::bench
