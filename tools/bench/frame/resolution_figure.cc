#include "tools/bench/frame/resolution_figure.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "tools/bench/frame/frame_bench.h"
#include "tools/bench/log_plot.h"

namespace voxeld::bench::frame {
namespace {

constexpr double kBeside = 0.6;  // time of the guide, as a share of the slowest

}  // namespace

std::string ResolutionSvg(const nlohmann::json& rows) {
  std::map<std::string, std::map<double, double>> times;  // by machine and side
  std::set<double> sides;
  for (const nlohmann::json& row : rows) {
    if (!absl::StartsWith(std::string(row["scene"]), "implicit")) continue;
    const double side = row["grid"][0];
    times[MachineText(row)][side] = row["device_ms"]["median"];
    sides.insert(side);
  }
  if (sides.empty()) return {};
  std::vector<Curve> curves;
  double slowest = 0;  // at the greatest side
  for (const auto& [machine, points] : times) {
    curves.push_back({machine, true, {points.begin(), points.end()}});
    const auto& [side, time] = *points.rbegin();
    const double scale = *sides.rbegin() / side;
    slowest = std::max(slowest, time * scale * scale);
  }
  Curve guide{.name = "as the square of the resolution", .guide = true};
  for (const double side : sides) {
    const double scale = side / *sides.rbegin();
    guide.points.emplace_back(side, kBeside * slowest * scale * scale);
  }
  curves.push_back(std::move(guide));
  return LogLogSvg("An implicit sphere drawn anew: time and resolution",
                   "voxels along each of the display's three sides", "milliseconds a frame", curves,
                   {sides.begin(), sides.end()});
}

}  // namespace voxeld::bench::frame
