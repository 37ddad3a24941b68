#include "tools/voxelctl/text/troubles.h"

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {

std::vector<std::string> Troubles(const v1::Stats& stats) {
  const v1::ConnectionStats& connections = stats.connections();
  std::vector<std::string> out;
  for (const std::string& trouble :
       {connections.unreachable(), connections.accept_trouble(), connections.access_trouble(),
        connections.config_trouble(), stats.state().trouble(), stats.assets().trouble(),
        stats.process().trouble(), stats.process().time_trouble()}) {
    if (!trouble.empty()) out.push_back(EscapeForTerminal(trouble));
  }
  for (const v1::DisplayStats& display : stats.displays()) {
    // A lost display's state already reports the error and its reason.
    if (display.device_trouble().empty() || display.state() == v1::DISPLAY_STATE_LOST) continue;
    out.push_back(EscapeForTerminal(
        absl::StrCat("display ", display.name(), ": ", display.device_trouble())));
  }
  return out;
}

}  // namespace voxeld::voxelctl
