#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

using Align = Table::Align;

std::string BlendText(v1::BlendMode blend) {
  if (blend == v1::BLEND_MODE_UNSPECIFIED) blend = v1::BLEND_MODE_OVER;
  return absl::AsciiStrToLower(absl::StripPrefix(v1::BlendMode_Name(blend), "BLEND_MODE_"));
}

std::string LayersText(const v1::ListEntitiesResponse& response) {
  Table table({{"OWNER", Align::kRight},
               {"LAYER"},
               {"CLIENT"},
               {"ORDER", Align::kRight},
               {"BLEND"},
               {"OPACITY", Align::kRight},
               {"VISIBLE"},
               {"ENTITIES", Align::kRight},
               {"BYTES", Align::kRight},
               {"ORPHANED"}});
  for (const v1::LayerInfo& layer : response.layers()) {
    table.Add({absl::StrCat(layer.owner()), layer.layer(), layer.client_name(),
               absl::StrCat(layer.order()), BlendText(layer.blend()), absl::StrCat(layer.opacity()),
               layer.visible() ? "yes" : "no", Grouped(layer.entities()), Bytes(layer.bytes()),
               layer.orphaned() ? "yes" : "no"});
  }
  return table.Text();
}

std::string EntitiesText(const v1::ListEntitiesResponse& response) {
  Table table({{"OWNER", Align::kRight},
               {"LAYER"},
               {"ID"},
               {"KIND"},
               {"VERTICES", Align::kRight},
               {"BYTES", Align::kRight},
               {"PRIORITY", Align::kRight},
               {"LABEL"}});
  for (const v1::EntityInfo& entity : response.entities()) {
    table.Add({absl::StrCat(entity.key().owner()), entity.key().layer(), entity.key().id(),
               entity.erase() ? absl::StrCat(entity.kind(), " (erases)") : entity.kind(),
               Grouped(entity.vertices()), Bytes(entity.bytes()), absl::StrCat(entity.priority()),
               entity.label()});
  }
  return table.Text();
}

}  // namespace

absl::Status Entities(const EntitiesOptions& options, Connection& connection, Console& console) {
  v1::ListEntitiesRequest request;
  request.set_layer(options.layer);
  request.set_owner(options.owner);
  const absl::StatusOr<v1::ListEntitiesResponse> response = connection.ListEntities(request);
  if (!response.ok()) return response.status();
  if (console.json()) {
    console.Data(JsonText(ToJson(*response), false));
    return absl::OkStatus();
  }
  if (response->layers().empty() && response->entities().empty()) {
    console.Say(options.layer.empty() ? "nothing is up"
                                      : absl::StrCat("nothing is up in the layer ",
                                                     EscapeForTerminal(options.layer)));
    return absl::OkStatus();
  }
  console.Data(absl::StrCat(LayersText(*response), "\n", EntitiesText(*response)));
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
