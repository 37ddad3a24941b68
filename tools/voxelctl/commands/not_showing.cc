#include "tools/voxelctl/commands/not_showing.h"

#include <chrono>

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

std::vector<std::string> Unseen(uint64_t owner, const std::string& layer,
                                const std::vector<std::string>& ids, Connection& connection) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point until = Clock::now() + std::chrono::milliseconds(1500);
  const absl::StatusOr<v1::ListDisplaysResponse> displays = connection.ListDisplays();
  std::vector<std::string> sentences;
  if (!displays.ok()) return sentences;
  for (const std::string& id : ids) {
    std::string why;
    bool seen = displays->displays().empty();
    for (const v1::DisplayDescription& display : displays->displays()) {
      v1::ExplainEntityRequest request;
      request.mutable_key()->set_owner(owner);
      request.mutable_key()->set_layer(layer);
      request.mutable_key()->set_id(id);
      request.set_display(display.name());
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now());
      if (left.count() <= 0) return sentences;
      const absl::StatusOr<v1::ExplainEntityResponse> answer =
          connection.ExplainEntity(request, left);
      seen |= !answer.ok() || answer->visibility() == v1::VISIBILITY_SEEN ||
              answer->visibility() == v1::VISIBILITY_ERASES;
      if (seen) break;
      if (why.empty()) why = absl::StrCat("on display ", display.name(), ": ", answer->text());
    }
    if (seen) continue;
    sentences.push_back(
        EscapeForTerminal(absl::StrCat("nothing of \"", id, "\" can be seen ", why)));
  }
  return sentences;
}

}  // namespace voxeld::voxelctl
