// What a run says: figures with their spread, and where and how they were measured.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tools/bench/voxel_bench/statistics.h"
#include "tools/bench/voxel_bench/tally.h"

namespace voxeld::bench {

// {benchmark, time, machine, build, options, figures: [], …}. What benchmarks add beside `figures`
// is their own.
nlohmann::json ReportOf(const std::string& benchmark, nlohmann::json options);

// Appends {name, unit, median, min, max, values} to the report's figures.
void AddFigure(nlohmann::json& report, const std::string& name, const std::string& unit,
               const Spread& spread);
// One that was measured once.
void AddFigure(nlohmann::json& report, const std::string& name, const std::string& unit,
               double value);

// Every count, the outcomes that are pending, and `exact`: that they add up.
nlohmann::json ToJson(const Tally& tally);

// The figures as lines for people, below what the benchmark says itself (`text`).
std::string TextOf(const nlohmann::json& report);

// "model name" of the text of /proc/cpuinfo; "unknown" if there is none.
std::string CpuModelIn(const std::string& cpuinfo);

}  // namespace voxeld::bench
