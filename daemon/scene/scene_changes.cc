#include "daemon/scene/scene_changes.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <variant>
#include <vector>

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

// An entity of this size counts twice.
constexpr uint64_t kBytesPerUnit = 4096;
// A layer whose appearance changes is only blended again where its entities are.
constexpr uint64_t kEntitiesPerUnitOfLook = 16;

uint64_t SizeOf(const Layer& layer) { return layer.entities.size() + layer.bytes / kBytesPerUnit; }

uint64_t SizeOf(const Entity& entity, uint64_t owner, const Snapshot& scene) {
  const uint64_t bytes = entity.bytes / kBytesPerUnit;
  if (const auto* group = std::get_if<GroupPtr>(&entity.data.content)) {
    return std::max<uint64_t>(1, (*group)->parts.size()) + bytes;
  }
  if (const auto* instance = std::get_if<InstanceRef>(&entity.data.content)) {
    const Object* const object = scene.FindObject({owner, instance->object});
    return std::max<uint64_t>(1, object == nullptr ? 1 : object->drawables);
  }
  return 1 + bytes;
}

uint64_t ChangeOf(uint64_t owner, const Layer* was, const Layer* is, const Snapshot& after,
                  uint64_t most) {
  if (is == nullptr) return SizeOf(*was);
  if (was == nullptr) return SizeOf(*is);
  if (was->number != is->number) return SizeOf(*was) + SizeOf(*is);
  if (was->transform != is->transform) return std::max(SizeOf(*was), SizeOf(*is));
  uint64_t change = 0;
  if (!ListsSame(*was, *is)) {
    change = is->entities.size() / kEntitiesPerUnitOfLook;
  }
  EntityMap::DiffFrom(was->entities, is->entities, "",
                      [&](const std::string&, const EntityPtr*, const EntityPtr* entity) {
                        change += entity == nullptr ? 1 : SizeOf(**entity, owner, after);
                        return change < most;
                      });
  return change;
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

std::map<uint64_t, uint64_t> ChangesByOwner(const Snapshot& before, const Snapshot& after,
                                            uint64_t most, const std::set<uint64_t>& skip) {
  std::map<uint64_t, uint64_t> changes;
  PersistentMap<OwnedName, LayerPtr>::Diff(
      before.layers, after.layers,
      [&](const OwnedName& key, const LayerPtr* was, const LayerPtr* is) {
        if (skip.contains(key.owner)) return;
        uint64_t& change = changes[key.owner];
        if (change < most) change += ChangeOf(key.owner, Get(was), Get(is), after, most - change);
      });
  // Instances of an object whose definition changed are drawn again.
  PersistentMap<OwnedName, ObjectPtr>::Diff(
      before.objects, after.objects,
      [&](const OwnedName& key, const ObjectPtr* was, const ObjectPtr* is) {
        if (was == nullptr || is == nullptr || skip.contains(key.owner)) return;
        uint64_t& change = changes[key.owner];
        if (change >= most) return;
        after.uses.ForEachFrom({key.owner, key.name, false, "", ""}, [&](const UseKey& use, bool) {
          if (use.owner != key.owner || use.object != key.name || use.by_object) return false;
          change += std::max<uint64_t>(1, (*is)->drawables);
          return change < most;
        });
      });
  return changes;
}

SnapshotPtr WithPartsOf(const Snapshot& scene, const Snapshot& part,
                        const std::set<uint64_t>& owners) {
  auto joined = std::make_shared<Snapshot>(scene);
  for (const uint64_t owner : owners) {
    const OwnedName from{owner, ""}, to{owner + 1, ""};
    joined->layers = joined->layers.WithRangeOf(part.layers, from, to);
    joined->objects = joined->objects.WithRangeOf(part.objects, from, to);
    // An operator hides an owner at once.
    std::vector<std::pair<OwnedName, LayerPtr>> hidden_or_shown;
    joined->layers.ForEachFrom(from, [&](const OwnedName& key, const LayerPtr& layer) {
      if (key.owner != owner) return false;
      const Layer* const now = scene.FindLayer(key);
      if (now == nullptr || now->suppressed == layer->suppressed) return true;
      auto changed = std::make_shared<Layer>(*layer);
      changed->suppressed = now->suppressed;
      hidden_or_shown.emplace_back(key, std::move(changed));
      return true;
    });
    for (auto& [key, layer] : hidden_or_shown) joined->layers.Put(key, std::move(layer));
    static constexpr OwnerTally kNothing;
    const OwnerTally* const was = scene.owners.Find(owner);
    const OwnerTally* const is = part.owners.Find(owner);
    for (const auto count :
         {&OwnerTally::drawables, &OwnerTally::layers, &OwnerTally::bytes, &OwnerTally::derived}) {
      joined->total.*count +=
          (is == nullptr ? kNothing : *is).*count - (was == nullptr ? kNothing : *was).*count;
    }
    if (is != nullptr) {
      joined->owners.Put(owner, *is);
    } else {
      joined->owners.Erase(owner);
    }
  }
  return joined;
}

}  // namespace voxeld::daemon
