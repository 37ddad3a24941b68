#include "tools/voxelctl/commands/display_names.h"

namespace voxeld::voxelctl {

absl::StatusOr<std::vector<std::string>> DisplayNames(const std::string& wanted,
                                                      Connection& connection) {
  if (!wanted.empty()) return std::vector<std::string>{wanted};
  const absl::StatusOr<v1::ListDisplaysResponse> displays = connection.ListDisplays();
  if (!displays.ok()) return displays.status();
  std::vector<std::string> names;
  for (const v1::DisplayDescription& display : displays->displays())
    names.push_back(display.name());
  if (names.empty()) return absl::FailedPreconditionError("the server has no display");
  return names;
}

}  // namespace voxeld::voxelctl
