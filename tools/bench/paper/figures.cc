#include "tools/bench/paper/figures.h"

#include <map>

#include "absl/strings/str_cat.h"
#include "tools/bench/log_plot.h"
#include "tools/bench/paper/tables.h"

namespace voxeld::bench::paper {
namespace {

using nlohmann::json;

std::string PaperName(size_t machine) {
  return absl::StrCat(std::string(kHardware[machine].name), " (", kHardware[machine].year, ")");
}

// Returns the readable name of a row whose result ends on the host.
std::string OurName(const json& row) {
  if (row["engine"] == "cuda") return "ours, CUDA with the copy";
  if (row["engine"] == "auto") return "ours, auto";
  return row["threads"] == 1 ? "ours, CPU, 1 thread"
                             : absl::StrCat("ours, CPU, ", int(row["threads"]), " threads");
}

template <typename Rows>
std::vector<Curve> CurvesOf(const json& report, const std::string& table, const Rows& rows,
                            bool cpus) {
  std::vector<Curve> curves;
  for (size_t machine = cpus ? 0 : 1; machine < kMachines; ++machine) {
    Curve curve{PaperName(machine), false, {}};
    for (const Row& row : rows)
      curve.points.emplace_back(static_cast<double>(row.voxels), row.ms[machine]);
    curves.push_back(std::move(curve));
  }
  std::map<std::string, Curve> ours;
  for (const json& row : report["rows"]) {
    if (row["table"] != table || !row["host_copy"]) continue;
    if (!cpus && row["engine"] != "cuda") continue;
    Curve& curve = ours[OurName(row)];
    curve.points.emplace_back(double(row["voxels"]) / double(row["segments"]), double(row["ms"]));
  }
  for (auto& [name, curve] : ours) curves.push_back({name, true, std::move(curve.points)});
  return curves;
}

bool Measured(const json& report, const std::string& table) {
  for (const json& row : report["rows"]) {
    if (row["table"] == table) return true;
  }
  return false;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> FiguresOf(const json& report) {
  std::vector<std::pair<std::string, std::string>> out;
  const auto add = [&](int number, const std::string& what, const std::string& table,
                       const auto& rows, bool cpus) {
    if (!Measured(report, table)) return;
    out.emplace_back(absl::StrCat("paper-figure-", number, ".svg"),
                     LogLogSvg(absl::StrCat("Figure ", number, " again: ", what),
                               "voxels of a segment", "milliseconds, the copy to the host included",
                               CurvesOf(report, table, rows, cpus)));
  };
  add(5, "one segment, CPUs and GPUs", "2", kTable2, true);
  add(6, "one segment, GPUs", "2", kTable2, false);
  add(7, "1024 segments of one length, CPUs and GPUs", "3", kTable3, true);
  add(8, "1024 segments of one length, GPUs", "3", kTable3, false);
  std::vector<Bar> bars;
  for (size_t machine = 0; machine < kMachines; ++machine) {
    bars.push_back(
        {PaperName(machine), false, static_cast<double>(kGigavoxel) / kTable4[machine] / 1e3});
  }
  bool ours = false;
  for (const json& row : report["rows"]) {
    if (row["table"] != "4" || row["voxels"] != kGigavoxel || !row["host_copy"]) continue;
    bars.push_back({OurName(row), true, double(row["mvoxel_per_s"])});
    ours = true;
  }
  if (ours) {
    out.emplace_back("paper-figure-9.svg",
                     LogBarsSvg("Figure 9 again: 1024 segments of different lengths, one Gvoxel",
                                "Mvoxel/s, the copy to the host included", bars));
  }
  return out;
}

}  // namespace voxeld::bench::paper
