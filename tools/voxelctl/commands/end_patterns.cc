#include "tools/voxelctl/commands/end_patterns.h"

namespace voxeld::voxelctl {

absl::StatusOr<std::vector<std::string>> EndPatterns(Connection& connection) {
  const absl::StatusOr<v1::ListDisplaysResponse> displays = connection.ListDisplays();
  if (!displays.ok()) return displays.status();
  std::vector<std::string> ended;
  for (const v1::DisplayDescription& display : displays->displays()) {
    if (display.test_pattern() == v1::TEST_PATTERN_NONE ||
        display.test_pattern() == v1::TEST_PATTERN_UNSPECIFIED)
      continue;
    v1::UpdateDisplayRequest request;
    request.set_name(display.name());
    request.set_test_pattern(v1::TEST_PATTERN_NONE);
    const absl::StatusOr<v1::DisplayDescription> updated = connection.UpdateDisplay(request);
    if (!updated.ok()) return updated.status();
    ended.push_back(display.name());
  }
  return ended;
}

}  // namespace voxeld::voxelctl
