#include "daemon/scene/scene_changes.h"

#include <memory>
#include <utility>

namespace voxeld::daemon {
namespace {

// Returns: the smallest key greater than `key`.
std::string Beyond(std::string key) {
  key.push_back('\0');
  return key;
}
OwnedName Beyond(const OwnedName& key) { return {key.owner, Beyond(key.name)}; }

bool ListsSame(const WriterPtr& a, const WriterPtr& b) {
  return a == b ||
         (a->client_name == b->client_name && a->ended == b->ended);  // watchers do not see `keep`
}

bool ListsSame(const Layer& a, const Layer& b) {
  return a.visible == b.visible && a.opacity == b.opacity && a.order == b.order &&
         a.blend == b.blend && a.transform == b.transform && a.clip == b.clip &&
         a.region == b.region && a.mask == b.mask && ListsSame(a.writer, b.writer);
}

// Returns: the previous layer with the same name, if it is still the same layer.
const Layer* Same(const Layer* was, const Layer& is) {
  return was != nullptr && was->number == is.number ? was : nullptr;
}

template <typename T>
const T* Get(const std::shared_ptr<const T>* held) {
  return held == nullptr ? nullptr : held->get();
}

}  // namespace

SceneChanges::SceneChanges(SceneFilter filter, SnapshotPtr before, SnapshotPtr after)
    : filter_(std::move(filter)),
      before_(before == nullptr ? std::make_shared<const Snapshot>() : std::move(before)),
      after_(std::move(after)),
      objects_told_(!filter_.objects),
      from_{filter_.owner, ""} {}

bool SceneChanges::Matches(const OwnedName& key) const {
  return filter_.layer.empty() || key.name == filter_.layer;
}

bool SceneChanges::Next(SceneChangeVisitor& visitor) {
  if (!objects_told_) {
    if (!TellObjects(visitor)) return false;
    objects_told_ = true;
    from_ = {filter_.owner, ""};
  }
  if (inside_.has_value()) {
    const OwnedName key = *inside_;
    const Layer& is = *after_->FindLayer(key);
    if (!TellEntities(Same(before_->FindLayer(key), is), is, visitor)) return false;
  }
  return TellLayers(visitor);
}

bool SceneChanges::TellObjects(SceneChangeVisitor& visitor) {
  bool beyond = false;  // past the requested owner
  const bool whole = PersistentMap<OwnedName, ObjectPtr>::DiffFrom(
      before_->objects, after_->objects, from_,
      [&](const OwnedName& key, const ObjectPtr* was, const ObjectPtr* is) {
        if (filter_.owner != 0 && key.owner != filter_.owner) {
          beyond = true;
          return false;
        }
        from_ = Beyond(key);
        if (is == nullptr) return visitor.OnRemovedObject(key);
        // An object is also put again when an object that it refers to changes; its definition is
        // then the same.
        if (was != nullptr && (*was)->data == (*is)->data) return true;
        return visitor.OnObject(key, **is);
      });
  return whole || beyond;
}

bool SceneChanges::TellLayers(SceneChangeVisitor& visitor) {
  bool beyond = false;
  const bool whole = PersistentMap<OwnedName, LayerPtr>::DiffFrom(
      before_->layers, after_->layers, from_,
      [&](const OwnedName& key, const LayerPtr* was, const LayerPtr* is) {
        if (filter_.owner != 0 && key.owner != filter_.owner) {
          beyond = true;
          return false;
        }
        from_ = Beyond(key);
        return !Matches(key) || TellLayer(key, Get(was), Get(is), visitor);
      });
  return whole || beyond;
}

bool SceneChanges::TellLayer(const OwnedName& key, const Layer* was, const Layer* is,
                             SceneChangeVisitor& visitor) {
  if (is == nullptr) return visitor.OnRemovedLayer(key);
  const Layer* same = Same(was, *is);
  bool room = true;
  if (was != nullptr && same == nullptr) room = visitor.OnRemovedLayer(key);
  // Reported even if there is no room, because the position between the two calls would be inside a
  // layer.
  if (same == nullptr || !ListsSame(*same, *is)) room = visitor.OnLayer(key, *is) && room;
  inside_ = key;
  entity_from_.clear();
  return room && TellEntities(same, *is, visitor);
}

bool SceneChanges::TellEntities(const Layer* was, const Layer& is, SceneChangeVisitor& visitor) {
  const bool whole =
      EntityMap::DiffFrom(was == nullptr ? EntityMap() : was->entities, is.entities, entity_from_,
                          [&](const std::string& id, const EntityPtr*, const EntityPtr* entity) {
                            entity_from_ = Beyond(id);
                            return entity == nullptr ? visitor.OnRemovedEntity(*inside_, id)
                                                     : visitor.OnEntity(*inside_, id, **entity);
                          });
  if (whole) inside_.reset();
  return whole;
}

}  // namespace voxeld::daemon
