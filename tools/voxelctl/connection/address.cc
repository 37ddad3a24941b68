#include "tools/voxelctl/connection/address.h"

#include "common/text/printable.h"

namespace voxeld::voxelctl {

std::string ChooseServer(const std::string& option, const Environment& environment) {
  return option.empty() ? client::DefaultAddress(environment) : option;
}

absl::StatusOr<std::string> ServerTarget(const std::string& address) {
  absl::StatusOr<std::string> target = client::ServerTarget(address);
  if (target.ok()) return target;
  return absl::Status(target.status().code(), EscapeForTerminal(target.status().message()));
}

}  // namespace voxeld::voxelctl
