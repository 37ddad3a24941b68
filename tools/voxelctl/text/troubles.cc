#include "tools/voxelctl/text/troubles.h"

#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {

std::vector<std::string> Troubles(const v1::Stats& stats) {
  const v1::ConnectionStats& connections = stats.connections();
  std::vector<std::string> out;
  for (const std::string& trouble :
       {connections.unreachable(), connections.access_trouble(), connections.config_trouble(),
        stats.state().trouble(), stats.assets().trouble(), stats.process().trouble()}) {
    if (!trouble.empty()) out.push_back(EscapeForTerminal(trouble));
  }
  return out;
}

}  // namespace voxeld::voxelctl
