#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/shape/shape_text.h"
#include "tools/voxelctl/text/escape.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kLabelBytes = 200;

absl::StatusOr<v1::ApplyUpdateRequest> RequestOf(const DrawOptions& options) {
  v1::ApplyUpdateRequest request;
  request.mutable_open()->set_client_name("voxelctl draw");
  request.mutable_open()->set_strict(true);
  std::vector<std::string> errors;
  for (size_t i = 0; i < options.shapes.size(); ++i) {
    absl::StatusOr<v1::Entity> entity = ParseShapeText(options.shapes[i]);
    if (!entity.ok()) {
      errors.push_back(absl::StrCat("\"", EscapeForTerminal(options.shapes[i]),
                                    "\": ", entity.status().message()));
      continue;
    }
    if (entity->label().empty() && options.shapes[i].size() <= kLabelBytes)
      entity->set_label(options.shapes[i]);
    v1::Upsert* const upsert = request.add_operations()->mutable_upsert();
    upsert->set_layer(kLayer);
    upsert->set_id(absl::StrCat("draw ", i + 1));
    *upsert->mutable_entity() = *std::move(entity);
  }
  if (!errors.empty()) return absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
  return request;
}

// Who has something in our layer: what an earlier command left.
absl::StatusOr<std::vector<uint64_t>> OwnersBefore(Connection& connection) {
  v1::ListEntitiesRequest request;
  request.set_layer(kLayer);
  const absl::StatusOr<v1::ListEntitiesResponse> response = connection.ListEntities(request);
  if (!response.ok()) return response.status();
  std::vector<uint64_t> owners;
  for (const v1::LayerInfo& layer : response->layers()) owners.push_back(layer.owner());
  return owners;
}

absl::Status TakeDown(const std::vector<uint64_t>& owners, Connection& connection) {
  for (const uint64_t owner : owners) {
    v1::ClearLayerRequest request;
    request.set_owner(owner);
    request.set_layer(kLayer);
    const absl::StatusOr<v1::ClearLayerResponse> cleared = connection.ClearLayer(request);
    if (!cleared.ok() && !absl::IsNotFound(cleared.status())) return cleared.status();
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status Draw(const DrawOptions& options, const Connector& connect, Console& console) {
  const absl::StatusOr<v1::ApplyUpdateRequest> request = RequestOf(options);
  if (!request.ok()) return request.status();
  absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
  absl::StatusOr<std::vector<uint64_t>> before = std::vector<uint64_t>();
  if (!options.add) before = OwnersBefore(connection);
  if (!before.ok()) return before.status();
  const absl::StatusOr<v1::ApplyUpdateResponse> applied = connection.ApplyUpdate(*request);
  if (!applied.ok()) return applied.status();
  if (absl::Status status = TakeDown(*before, connection); !status.ok()) return status;
  if (console.json()) {
    console.Data(JsonText(
        {{"layer", kLayer}, {"shapes", options.shapes.size()}, {"snapshot", applied->snapshot()}},
        false));
    return absl::OkStatus();
  }
  console.Say(absl::StrCat(Counted(options.shapes.size(), "shape"), " up, in the layer \"", kLayer,
                           "\"; `voxelctl snapshot OUT.png` shows what the display shows, "
                           "`voxelctl clear` takes it down"));
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
