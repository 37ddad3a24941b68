#include "tools/voxelctl/commands/own_layer.h"

#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/shape/drawing.h"

namespace voxeld::voxelctl {

absl::StatusOr<std::vector<uint64_t>> OwnersBefore(Connection& connection) {
  v1::ListEntitiesRequest request;
  request.set_layer(kLayer);
  const absl::StatusOr<v1::ListEntitiesResponse> response = connection.ListEntities(request);
  if (!response.ok()) return response.status();
  std::vector<uint64_t> owners;
  owners.reserve(static_cast<size_t>(response->layers_size()));
  for (const v1::LayerInfo& layer : response->layers()) owners.push_back(layer.owner());
  return owners;
}

absl::Status TakeDown(const std::vector<uint64_t>& owners, Connection& connection) {
  for (const uint64_t owner : owners) {
    if (owner == 0) continue;  // would stand for all
    for (const char* const layer : {kLayer, kMaskLayer}) {
      v1::ClearLayerRequest request;
      request.set_owner(owner);
      request.set_layer(layer);
      const absl::StatusOr<v1::ClearLayerResponse> cleared = connection.ClearLayer(request);
      if (!cleared.ok() && !absl::IsNotFound(cleared.status())) return cleared.status();
    }
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
