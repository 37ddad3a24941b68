#include "tools/voxelctl/commands/not_showing.h"

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {

std::vector<std::string> NotShowing(const v1::ListDisplaysResponse& displays) {
  std::vector<std::string> sentences;
  for (const v1::DisplayDescription& display : displays.displays()) {
    if (display.state() == v1::DISPLAY_STATE_SHOWING) continue;
    const std::string name = v1::DisplayState_Name(display.state());
    const std::string state = absl::AsciiStrToLower(absl::StripPrefix(name, "DISPLAY_STATE_"));
    sentences.push_back(EscapeForTerminal(
        absl::StrCat("display ", display.name(), " shows nothing now: it is ", state,
                     display.state_reason().empty() || display.state_reason() == state
                         ? ""
                         : absl::StrCat(" (", display.state_reason(), ")"))));
  }
  return sentences;
}

}  // namespace voxeld::voxelctl
