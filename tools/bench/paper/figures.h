// The paper's Figures 5 to 9 with our measurements added.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::bench::paper {

// Returns file names and contents, made from a report's rows (paper_bench.h). Figures of tables
// that were not measured are left out. All times include the copy to the host.
std::vector<std::pair<std::string, std::string>> FiguresOf(const nlohmann::json& report);

}  // namespace voxeld::bench::paper
