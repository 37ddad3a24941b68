#include "tests/daemon/core/model/engine_picture.h"

#include <utility>

namespace voxeld::daemon::model {

PlainScene::Picture PictureOf(const testing::SceneModel& scene) {
  PlainScene::Picture picture;
  for (const auto& [number, layer] : scene.layers()) {
    std::vector<std::string> drawables;
    for (const auto& [id, drawable] : scene.drawables()) {
      if (drawable.layer != number) continue;
      const testing::SceneModel::Geometry& geometry = scene.geometries().at(drawable.geometry);
      drawables.push_back(DrawableText(drawable.priority, drawable.erase != 0, drawable.transform,
                                       geometry.record, geometry.positions));
    }
    picture.Add(layer.visible != 0,
                LayerText(layer.order, layer.opacity, layer.blend, layer.transform, layer.planes,
                          layer.plane_count, layer.has_region != 0 ? &layer.region : nullptr),
                std::move(drawables));
  }
  return picture;
}

}  // namespace voxeld::daemon::model
