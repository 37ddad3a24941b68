// The paper's Figures 5 to 9 with ours in them.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::bench::paper {

// Names of files and their contents, of a report's rows (paper_bench.h). Those of tables that were not measured
// are left out. All times include the copy to the host.
std::vector<std::pair<std::string, std::string>> FiguresOf(const nlohmann::json& report);

}  // namespace voxeld::bench::paper
