#include "tools/voxelctl/commands/own_layer.h"

#include "tools/voxelctl/shape/drawing.h"

namespace voxeld::voxelctl {

absl::StatusOr<std::vector<OwnedLayer>> DrawnBefore(Connection& connection) {
  std::vector<OwnedLayer> found;
  for (const char* const name : {kLayer, kMaskLayer}) {
    v1::ListEntitiesRequest request;
    request.set_layer(name);
    const absl::StatusOr<v1::ListEntitiesResponse> response =
        connection.ListEntities(request, /*first_page_only=*/true);
    if (!response.ok()) return response.status();
    for (const v1::LayerInfo& layer : response->layers()) {
      if (layer.layer() == name) found.push_back({layer.owner(), name});
    }
  }
  return found;
}

}  // namespace voxeld::voxelctl
