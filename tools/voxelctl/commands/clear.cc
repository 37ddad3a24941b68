#include "absl/strings/str_cat.h"
#include "tools/voxelctl/cli/patterns.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/display_names.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/text/escape.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
absl::Status Clear(const ClearOptions& options, Connection& connection, Console& console) {
  v1::ClearLayerRequest request;
  if (!options.all) request.set_layer(options.layer.empty() ? kLayer : options.layer);
  absl::StatusOr<v1::ClearLayerResponse> cleared = connection.ClearLayer(request);
  // A layer that is not there is as clear as can be.
  if (absl::IsNotFound(cleared.status())) cleared = v1::ClearLayerResponse();
  if (!cleared.ok()) return cleared.status();
  if (!options.all && options.layer.empty()) {
    request.set_layer(kMaskLayer);
    const absl::StatusOr<v1::ClearLayerResponse> masks = connection.ClearLayer(request);
    if (!masks.ok() && !absl::IsNotFound(masks.status())) return masks.status();
    if (masks.ok()) {
      cleared->set_entities(cleared->entities() + masks->entities());
      cleared->set_layers(cleared->layers() + masks->layers());
    }
  }
  absl::StatusOr<std::vector<std::string>> patterns = std::vector<std::string>();
  if (options.layer.empty()) patterns = EndPatterns(connection);
  if (!patterns.ok()) return patterns.status();
  if (console.json()) {
    nlohmann::ordered_json json = ToJson(*cleared);
    json["patterns"] = patterns->size();
    console.Data(JsonText(json, false));
    return absl::OkStatus();
  }
  console.Say(absl::StrCat(
      "cleared ", Counted(cleared->entities(), "entity", "entities"), " in ",
      Counted(cleared->layers(), "layer"),
      patterns->empty() ? ""
                        : absl::StrCat(", ended ", Counted(patterns->size(), "test pattern"))));
  return absl::OkStatus();
}

absl::Status Pattern(const PatternOptions& options, Connection& connection, Console& console) {
  const absl::StatusOr<std::vector<std::string>> names = DisplayNames(options.display, connection);
  if (!names.ok()) return names.status();
  v1::ListDisplaysResponse updated;
  for (const std::string& name : *names) {
    v1::UpdateDisplayRequest request;
    request.set_name(name);
    request.set_test_pattern(options.pattern);
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
        EscapeForTerminal(display.name()),
        options.pattern == v1::TEST_PATTERN_NONE
            ? ": the scene again"
            : ": shows the pattern until `voxelctl pattern none` or `voxelctl clear`"));
  }
  return absl::OkStatus();
}

void ListPatterns(Console& console) {
  const std::vector<std::string> names = PatternNames();
  if (console.json()) {
    console.Data(JsonText(nlohmann::ordered_json{{"patterns", names}}, false));
    return;
  }
  for (const std::string& name : names) console.Data(absl::StrCat(name, "\n"));
}

}  // namespace voxeld::voxelctl
