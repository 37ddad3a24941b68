#include "daemon/scene/view_check.h"

#include <string>

#include "absl/strings/str_format.h"
#include "daemon/scene/quoted.h"

namespace voxeld::daemon {

absl::Status CheckView(const Draft& scene, const DisplayView& view, const Limits& limits) {
  absl::Status status;
  scene.ForEachLayer([&](const OwnedName& key, const Layer& layer) {
    if (!status.ok()) return;
    const gpu::Affine map = gpu::Compose(view.scene_to_voxel, layer.transform);
    const auto reach = [&](const Bounds& bounds) {
      return LargestMagnitude(MapBounds(map, bounds));
    };
    // The layer's own bounds may be wider than its content.
    if (reach(layer.bounds) <= limits.max_coordinate_voxels) return;
    layer.entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      const double largest =
          reach(MapBounds(entity->data.transform, scene.BoundsOf(key.owner, entity->data.content)));
      if (largest <= limits.max_coordinate_voxels || !status.ok()) return;
      status = absl::FailedPreconditionError(absl::StrFormat(
          "through this view entity %s of layer %s of owner %d would reach %g voxels on "
          "display \"%s\"; it must stay within ±%.0f",
          Quoted(id), Quoted(key.name), key.owner, largest, view.display,
          limits.max_coordinate_voxels));
    });
  });
  return status;
}

}  // namespace voxeld::daemon
