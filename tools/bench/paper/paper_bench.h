// The paper's Tables 2 to 4 again, on this machine, each figure beside its ceiling in the same run.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::bench::paper {

struct PaperOptions {
  std::vector<std::string> engines;  // of "cpu", "cuda", "auto"; empty: those that are here
  std::vector<std::string> tables;   // of "2", "3", "4"; empty: all
  double seconds = 0.2;              // at least, of each figure
  uint64_t voxels = 1'000'000'000;   // of Table 4's batches
  uint64_t seed = 1;
  std::string from;  // a report (JSON) to show again instead of measuring; empty: none
  std::string svg;   // a folder for the figures; empty: none
};

// {ceilings_gb_per_s: {…}, rows: [{table, segments, voxels, engine, threads, output, host_copy, ms, ms_least, ms_greatest,
// mvoxel_per_s, paper_mvoxel_per_s, paper_hardware, ceiling_mvoxel_per_s, ceiling_ratio, call, ceiling}], seed,
// vectors}. A paper's rate includes the copy to the host and is of its best machine in that row: null where ours
// does not, or it has no such row. `progress` takes a line for each row; false from `go_on` ends it with Cancelled.
absl::StatusOr<nlohmann::json> MeasurePaper(const PaperOptions& options,
                                            const std::function<void(const std::string&)>& progress,
                                            const std::function<bool()>& go_on);

// The tables for people, the paper's columns beside ours.
std::string PaperText(const nlohmann::json& report);

}  // namespace voxeld::bench::paper
