// The report of a run: figures with their spread, and where and how they were measured.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tools/bench/voxel_bench/statistics.h"
#include "tools/bench/voxel_bench/tally.h"

namespace voxeld::bench {

// Returns {benchmark, time, machine, build, options, figures: [], …}. Benchmarks may add other keys
// beside `figures`.
nlohmann::json ReportOf(const std::string& benchmark, nlohmann::json options);

// Appends {name, unit, median, min, max, values} to the report's figures.
void AddFigure(nlohmann::json& report, const std::string& name, const std::string& unit,
               const Spread& spread);
// Appends a figure that was measured once.
void AddFigure(nlohmann::json& report, const std::string& name, const std::string& unit,
               double value);

// Returns every count, the pending outcomes, and `exact`: whether the counts add up.
nlohmann::json ToJson(const Tally& tally);

// Returns the figures as readable lines, below the benchmark's own text (`text`).
std::string TextOf(const nlohmann::json& report);

// Returns the "model name" in the text of /proc/cpuinfo, or "unknown".
std::string CpuModelIn(const std::string& cpuinfo);

}  // namespace voxeld::bench
