#include "tools/recording/scene_mirror.h"

#include <utility>

namespace voxeld::recording {

const v1::Object* SceneMirror::FindObject(uint64_t owner, const std::string& name) const {
  const auto found = objects_.find({owner, name});
  return found == objects_.end() ? nullptr : &found->second;
}

void SceneMirror::Touch(const LayerName& layer) {
  const auto visible = layers_.find(layer);
  const bool shown = visible != layers_.end() && visible->second.visible();
  for (auto it = entities_.lower_bound({layer, ""});
       it != entities_.end() && it->first.layer == layer; ++it) {
    (shown ? changes_.changed : changes_.gone).insert(it->first);
    (shown ? changes_.gone : changes_.changed).erase(it->first);
  }
}

void SceneMirror::Apply(const v1::WatchSceneResponse& message) {
  for (const v1::LayerKey& key : message.removed_layers()) {
    const LayerName layer{key.owner(), key.layer()};
    layers_.erase(layer);
    Touch(layer);
    for (auto it = entities_.lower_bound({layer, ""});
         it != entities_.end() && it->first.layer == layer;) {
      it = entities_.erase(it);
    }
  }
  for (const v1::EntityKey& key : message.removed_entities()) {
    const EntityName name{{key.owner(), key.layer()}, key.id()};
    entities_.erase(name);
    changes_.changed.erase(name);
    changes_.gone.insert(name);
  }
  for (const v1::ObjectKey& key : message.removed_objects()) {
    objects_.erase({key.owner(), key.object()});
  }
  for (const v1::LayerInfo& info : message.layers()) {
    const LayerName layer{info.owner(), info.layer()};
    layers_[layer] = info;
    Touch(layer);
  }
  std::set<uint64_t> redefined;
  for (const v1::WatchedObject& object : message.objects()) {
    objects_[{object.key().owner(), object.key().object()}] = object.definition();
    redefined.insert(object.key().owner());
  }
  for (const v1::WatchedEntity& entity : message.entities()) {
    const v1::EntityKey& key = entity.info().key();
    const EntityName name{{key.owner(), key.layer()}, key.id()};
    entities_[name] = entity;
    const auto layer = layers_.find(name.layer);
    const bool shown = layer != layers_.end() && layer->second.visible();
    (shown ? changes_.changed : changes_.gone).insert(name);
    (shown ? changes_.gone : changes_.changed).erase(name);
  }
  if (redefined.empty()) return;
  // Marks everything that may refer to them.
  for (const auto& [name, entity] : entities_) {
    if (redefined.contains(name.layer.owner) && entity.primitive().has_instance() &&
        !changes_.gone.contains(name)) {
      changes_.changed.insert(name);
    }
  }
}

SceneMirror::Changes SceneMirror::TakeChanges() { return std::exchange(changes_, {}); }

}  // namespace voxeld::recording
