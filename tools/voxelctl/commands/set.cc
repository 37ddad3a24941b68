#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/display_names.h"
#include "tools/voxelctl/text/proto_json.h"

namespace voxeld::voxelctl {

absl::Status Set(const SetOptions& options, Connection& connection, Console& console) {
  const absl::StatusOr<std::vector<std::string>> names = DisplayNames(options.display, connection);
  if (!names.ok()) return names.status();
  v1::ListDisplaysResponse updated;
  for (const std::string& name : *names) {
    v1::UpdateDisplayRequest request;
    request.set_name(name);
    if (options.brightness) request.set_brightness(*options.brightness);
    if (options.blank) request.set_blank(*options.blank);
    if (options.power_limit_w) request.set_power_limit_w(*options.power_limit_w);
    absl::StatusOr<v1::DisplayDescription> display = connection.UpdateDisplay(request);
    if (!display.ok()) return display.status();
    *updated.add_displays() = *std::move(display);
  }
  if (console.json()) {
    console.Data(JsonText(ToJson(updated), false));
    return absl::OkStatus();
  }
  for (const v1::DisplayDescription& display : updated.displays()) {
    console.Say(absl::StrCat(
        EscapeForTerminal(display.name()), ": brightness ",
        absl::StrFormat("%.0f %%", display.brightness() * 100), display.blank() ? ", blank" : "",
        display.power_limit_w() > 0 ? absl::StrFormat(", at most %.6g W", display.power_limit_w())
                                    : ", no power limit"));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
