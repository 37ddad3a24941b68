#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/cli/patterns.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/display_names.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/not_showing.h"
#include "tools/voxelctl/connection/owned_layers.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

// Clears everything that is the caller's, or everybody's if it has the scope.
absl::StatusOr<TakenDown> ClearAll(Connection& connection) {
  const absl::StatusOr<v1::ClearLayerResponse> cleared = connection.ClearLayer({});
  TakenDown taken;
  if (cleared.ok()) {
    taken.entities = cleared->entities();
    taken.layers = cleared->layers();
  } else if (!TakesControl(cleared.status())) {
    return cleared.status();
  }
  const absl::StatusOr<v1::ListEntitiesResponse> left = connection.ListEntities({}, true);
  if (!left.ok()) return left.status();
  std::vector<OwnedLayer> layers;
  for (const v1::LayerInfo& layer : left->layers())
    layers.push_back({layer.owner(), layer.layer()});
  if (layers.empty()) return taken;
  // These layers are other owners', or were added meanwhile by a running client. Only one is tried,
  // which shows whether it is allowed, because each refusal is a line in the server's audit log.
  const absl::StatusOr<TakenDown> one = TakeDown({layers.front()}, connection);
  if (!one.ok()) return one.status();
  if (!one->stay.empty()) taken.stay = std::move(layers);
  return taken;
}

absl::StatusOr<TakenDown> ClearSome(const std::string& name, Connection& connection) {
  v1::ListEntitiesRequest request;
  request.set_layer(name);
  absl::StatusOr<v1::ListEntitiesResponse> found = connection.ListEntities(request, true);
  if (!found.ok()) return found.status();
  std::vector<OwnedLayer> layers;
  for (const v1::LayerInfo& layer : found->layers()) {
    const bool wanted = name.empty() ? layer.layer() == kLayer || layer.layer() == kMaskLayer ||
                                           IsLeftByVoxelctl(layer)
                                     : layer.layer() == name;
    if (wanted) layers.push_back({layer.owner(), layer.layer()});
  }
  return TakeDown(layers, connection);
}

}  // namespace

absl::Status Clear(const ClearOptions& options, Connection& connection, Console& console) {
  const absl::StatusOr<TakenDown> taken =
      options.all ? ClearAll(connection) : ClearSome(options.layer, connection);
  if (!taken.ok()) return taken.status();
  absl::StatusOr<EndedPatterns> patterns = EndedPatterns();
  if (options.layer.empty()) patterns = EndPatterns(connection);
  if (!patterns.ok()) return patterns.status();
  if (console.json()) {
    nlohmann::ordered_json stay = nlohmann::ordered_json::array();
    for (const OwnedLayer& layer : taken->stay) {
      stay.push_back({{"owner", layer.owner}, {"layer", layer.layer}});
    }
    console.Data(JsonText({{"entities", taken->entities},
                           {"layers", taken->layers},
                           {"patterns", patterns->ended.size()},
                           {"stay", stay},
                           {"patterns_stay", patterns->stay}},
                          false));
    return absl::OkStatus();
  }
  console.Say(absl::StrCat(
      "cleared ", Counted(taken->entities, "entity", "entities"), " in ",
      Counted(taken->layers, "layer"),
      patterns->ended.empty()
          ? ""
          : absl::StrCat(", ended ", Counted(patterns->ended.size(), "test pattern"))));
  for (const std::string& sentence : {OthersStay(taken->stay), PatternsStay(*patterns)}) {
    if (!sentence.empty()) console.Say(sentence);
  }
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
    console.Say(
        absl::StrCat(EscapeForTerminal(display.name()),
                     options.pattern == v1::TEST_PATTERN_NONE
                         ? ": test pattern ended"
                         : ": test pattern set until `voxelctl pattern none` or `voxelctl clear`"));
  }
  for (const std::string& sentence : NotShowing(updated)) console.Say(sentence);
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
