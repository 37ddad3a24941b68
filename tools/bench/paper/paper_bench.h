// Measures the paper's Tables 2 to 4 on this machine, each rate beside its ceiling in the same run.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace voxeld::bench::paper {

struct PaperOptions {
  std::vector<std::string> engines;  // of "cpu", "cuda", "auto"; empty: those that are available
  std::vector<std::string> tables;   // of "2", "3", "4"; empty: all
  double seconds = 0.2;              // minimum time of each measurement
  uint64_t voxels = 1'000'000'000;   // of Table 4's batches
  uint64_t seed = 1;
  std::string from;  // a JSON report to print instead of measuring; empty: none
  std::string svg;   // output folder for the figures; empty: none
};

// Runs the measurement.
// Returns: {ceilings_gb_per_s: {…}, rows: [{table, segments, voxels, engine, threads, output,
// host_copy, ms, ms_least, ms_greatest, mvoxel_per_s, paper_mvoxel_per_s, paper_hardware,
// ceiling_mvoxel_per_s, ceiling_ratio, call, ceiling}], seed, vectors}. The paper's rate includes
// the copy to the host and belongs to its best machine in that row; it is null if our rate does not
// include the copy or the paper has no such row. Calls `progress` with a line for each row.
// Errors: Cancelled if `go_on` returns false.
absl::StatusOr<nlohmann::json> MeasurePaper(const PaperOptions& options,
                                            const std::function<void(const std::string&)>& progress,
                                            const std::function<bool()>& go_on);

// Returns the tables as readable text, with the paper's columns beside ours.
std::string PaperText(const nlohmann::json& report);

}  // namespace voxeld::bench::paper
