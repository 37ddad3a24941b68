#include "tools/voxelctl/commands/end_patterns.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/not_showing.h"
#include "tools/voxelctl/connection/owned_layers.h"

namespace voxeld::voxelctl {

absl::StatusOr<EndedPatterns> EndPatterns(Connection& connection) {
  const absl::StatusOr<v1::ListDisplaysResponse> displays = connection.ListDisplays();
  if (!displays.ok()) return displays.status();
  EndedPatterns patterns;
  patterns.not_showing = NotShowing(*displays);
  for (const v1::DisplayDescription& display : displays->displays()) {
    if (display.test_pattern() == v1::TEST_PATTERN_NONE ||
        display.test_pattern() == v1::TEST_PATTERN_UNSPECIFIED)
      continue;
    v1::UpdateDisplayRequest request;
    request.set_name(display.name());
    request.set_test_pattern(v1::TEST_PATTERN_NONE);
    const absl::StatusOr<v1::DisplayDescription> updated = connection.UpdateDisplay(request);
    if (updated.ok()) {
      patterns.ended.push_back(display.name());
    } else if (TakesControl(updated.status())) {
      patterns.stay.push_back(display.name());
    } else {
      return updated.status();
    }
  }
  return patterns;
}

std::string PatternsStay(const EndedPatterns& patterns) {
  if (patterns.stay.empty()) return "";
  return absl::StrCat("a test pattern hides the scene on ",
                      EscapeForTerminal(absl::StrJoin(patterns.stay, ", ")),
                      "; ending it takes the scope control");
}

}  // namespace voxeld::voxelctl
