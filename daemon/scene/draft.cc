#include "daemon/scene/draft.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "gpu/derived_bytes.h"

namespace voxeld::daemon {

uint64_t AddSaturating(uint64_t a, uint64_t b) { return a > UINT64_MAX - b ? UINT64_MAX : a + b; }

uint64_t BytesOf(const Content& content) {
  if (const auto* geometry = std::get_if<GeometryPtr>(&content)) return (*geometry)->bytes();
  if (const auto* group = std::get_if<GroupPtr>(&content)) return (*group)->bytes();
  return sizeof(InstanceRef) + std::get<InstanceRef>(content).object.size();
}

uint64_t GroupData::bytes() const {
  uint64_t bytes = sizeof(*this) + as_sent.size() + parts.size() * sizeof(Part);
  const GeometryData* before = nullptr;
  for (const Part& part : parts) {
    // Parts that share a geometry are mostly consecutive. A shared geometry may be counted twice
    // but is never missed.
    if (part.geometry.get() != before) bytes += part.geometry->bytes();
    before = part.geometry.get();
  }
  return bytes;
}

namespace {

const InstanceRef* InstanceOf(const Content& content) { return std::get_if<InstanceRef>(&content); }

UseKey UseBy(const OwnedName& layer, const std::string& id, const InstanceRef& instance) {
  return {layer.owner, instance.object, false, layer.name, id};
}

}  // namespace

Draft::Draft(SnapshotPtr base, uint64_t& next_number)
    : base_(std::move(base)), next_number_(next_number), next_(*base_) {}

const Layer* Draft::FindLayer(const OwnedName& key) const {
  const auto it = open_.find(key);
  if (it != open_.end()) return it->second.has_value() ? &*it->second : nullptr;
  return next_.FindLayer(key);
}

const EntityPtr* Draft::FindEntity(const OwnedName& layer, const std::string& id) const {
  const Layer* l = FindLayer(layer);
  return l == nullptr ? nullptr : l->entities.Find(id);
}

const OwnerTally& Draft::tally(uint64_t owner) const {
  const auto it = tallies_.find(owner);
  if (it != tallies_.end()) return it->second;
  const OwnerTally* found = next_.owners.Find(owner);
  return tallies_.emplace(owner, found == nullptr ? OwnerTally() : *found).first->second;
}

void Draft::Count(uint64_t owner, const OwnerTally& more, const OwnerTally& less) {
  tally(owner);
  for (OwnerTally* counted : {&tallies_.find(owner)->second, &next_.total}) {
    counted->drawables += more.drawables - less.drawables;
    counted->layers += more.layers - less.layers;
    counted->bytes += more.bytes - less.bytes;
    counted->derived += more.derived - less.derived;
  }
}

uint64_t Draft::DrawablesOf(uint64_t owner, const Content& content) const {
  if (const auto* group = std::get_if<GroupPtr>(&content)) {
    return std::max<uint64_t>(1, (*group)->parts.size());
  }
  const InstanceRef* instance = InstanceOf(content);
  if (instance == nullptr) return 1;
  return std::max<uint64_t>(1, FindObject({owner, instance->object})->drawables);
}

uint64_t Draft::DerivedBytesOf(uint64_t owner, const Content& content) const {
  if (const InstanceRef* instance = InstanceOf(content)) {
    return FindObject({owner, instance->object})->derived;
  }
  const auto of = [](const GeometryPtr& geometry) {
    return kHeldBytesPerDrawable + gpu::MostDerivedBytes(geometry->record);
  };
  const auto* group = std::get_if<GroupPtr>(&content);
  if (group == nullptr) return of(std::get<GeometryPtr>(content));
  uint64_t bytes = 0;
  for (const GroupData::Part& part : (*group)->parts) bytes += of(part.geometry);
  return bytes;
}

Bounds Draft::BoundsOf(uint64_t owner, const Content& content) const {
  if (const InstanceRef* instance = InstanceOf(content)) {
    return FindObject({owner, instance->object})->bounds;
  }
  const auto from = [](const auto& extent) {
    Bounds bounds;
    bounds.empty = false;
    std::copy(std::begin(extent.min), std::end(extent.min), bounds.min);
    std::copy(std::begin(extent.max), std::end(extent.max), bounds.max);
    return bounds;
  };
  if (const auto* group = std::get_if<GroupPtr>(&content)) return from(**group);
  return from(*std::get<GeometryPtr>(content));
}

Layer& Draft::OpenLayer(const OwnedName& key) {
  const auto it = open_.find(key);
  if (it != open_.end()) return *it->second;
  return *open_.emplace(key, *next_.FindLayer(key)).first->second;
}

Layer& Draft::EditLayer(const OwnedName& key, const WriterPtr& writer) {
  if (FindLayer(key) == nullptr) {
    Layer layer;
    layer.number = next_number_++;
    layer.writer = writer;
    open_.insert_or_assign(key, std::move(layer));
    Count(key.owner, {.layers = 1, .bytes = LayerBytes(key)}, {});
  }
  Layer& layer = OpenLayer(key);
  if (layer.writer != writer) layer.writer = writer;
  return layer;
}

void Draft::RemoveLayer(const OwnedName& key) {
  ClearLayer(key);
  open_.insert_or_assign(key, std::nullopt);
  Count(key.owner, {}, {.layers = 1, .bytes = LayerBytes(key)});
}

void Draft::ClearLayer(const OwnedName& key) {
  Layer& layer = OpenLayer(key);
  layer.entities.ForEach(
      [&](const std::string& id, const EntityPtr& entity) { Unindex(key, id, *entity); });
  layer.entities = {};
  layer.bytes = 0;
  layer.bounds = {};
}

OwnerTally Draft::CountOf(const OwnedName& layer, const Entity& entity) const {
  return {.drawables = DrawablesOf(layer.owner, entity.data.content),
          .bytes = entity.bytes,
          .derived = DerivedBytesOf(layer.owner, entity.data.content)};
}

void Draft::Index(const OwnedName& layer, const std::string& id, const Entity& entity) {
  Count(layer.owner, CountOf(layer, entity), {});
  ++next_.entities;
  if (const InstanceRef* instance = InstanceOf(entity.data.content)) {
    next_.uses.Put(UseBy(layer, id, *instance), true);
  }
  if (entity.expires_ns != sync::kNever) {
    next_.expiries.Put({entity.expires_ns, entity.number}, {layer, id});
  }
}

void Draft::Unindex(const OwnedName& layer, const std::string& id, const Entity& entity) {
  Count(layer.owner, {}, CountOf(layer, entity));
  --next_.entities;
  if (const InstanceRef* instance = InstanceOf(entity.data.content)) {
    next_.uses.Erase(UseBy(layer, id, *instance));
  }
  if (entity.expires_ns != sync::kNever) {
    next_.expiries.Erase({entity.expires_ns, entity.number});
  }
}

uint64_t Draft::EntityBytes(const OwnedName& layer, const std::string& id, const EntityData& data) {
  return sizeof(Entity) + layer.name.size() + id.size() + data.label.size() + BytesOf(data.content);
}

uint64_t Draft::ObjectBytes(const std::string& name, const ObjectData& data) {
  uint64_t bytes = sizeof(Object) + name.size();
  for (const ObjectPart& part : data.parts) bytes += sizeof(ObjectPart) + BytesOf(part.content);
  return bytes;
}

void Draft::PutEntity(const OwnedName& layer, const std::string& id, Entity entity) {
  Layer& l = OpenLayer(layer);
  entity.bytes = EntityBytes(layer, id, entity.data);
  if (const EntityPtr* old = l.entities.Find(id)) {
    entity.number = (*old)->number;
    l.bytes -= (*old)->bytes;
    Unindex(layer, id, **old);
  } else if (entity.number == 0) {
    entity.number = next_number_++;
  }
  l.bytes += entity.bytes;
  l.bounds.Include(MapBounds(entity.data.transform, BoundsOf(layer.owner, entity.data.content)));
  Index(layer, id, entity);
  l.entities.Put(id, std::make_shared<const Entity>(std::move(entity)));
}

void Draft::RemoveEntity(const OwnedName& layer, const std::string& id) {
  Layer& l = OpenLayer(layer);
  const EntityPtr entity = *l.entities.Find(id);
  l.bytes -= entity->bytes;
  Unindex(layer, id, *entity);
  l.entities.Erase(id);
  if (l.entities.empty()) l.bounds = {};
}

void Draft::PutObject(const OwnedName& key, Object object) {
  const ObjectPtr* found = next_.objects.Find(key);
  const ObjectPtr old = found == nullptr ? nullptr : *found;

  object.bytes = ObjectBytes(key.name, *object.data);
  if (old != nullptr) {
    Count(key.owner, {}, {.bytes = old->bytes});
    for (const ObjectPart& part : old->data->parts) {
      if (const InstanceRef* child = InstanceOf(part.content)) {
        next_.uses.Erase({key.owner, child->object, true, key.name, ""});
      }
    }
  }
  Count(key.owner, {.bytes = object.bytes}, {});
  for (const ObjectPart& part : object.data->parts) {
    if (const InstanceRef* child = InstanceOf(part.content)) {
      next_.uses.Put({key.owner, child->object, true, key.name, ""}, true);
    }
  }
  if (old != nullptr) {
    // The counts and bounds of its instances change with it.
    const uint64_t before = std::max<uint64_t>(1, old->drawables);
    const uint64_t now = std::max<uint64_t>(1, object.drawables);
    std::vector<UseKey> instances;
    next_.uses.ForEachFrom({key.owner, key.name, false, "", ""}, [&](const UseKey& use, bool) {
      if (use.owner != key.owner || use.object != key.name || use.by_object) return false;
      instances.push_back(use);
      return true;
    });
    for (const UseKey& use : instances) {
      Count(key.owner, {.drawables = now, .derived = object.derived},
            {.drawables = before, .derived = old->derived});
      const OwnedName layer{use.owner, use.layer};
      const gpu::Affine transform = (*FindEntity(layer, use.id))->data.transform;
      OpenLayer(layer).bounds.Include(MapBounds(transform, object.bounds));
    }
  }
  next_.objects.Put(key, std::make_shared<const Object>(std::move(object)));
}

void Draft::RemoveObject(const OwnedName& key) {
  const ObjectPtr old = *next_.objects.Find(key);
  Count(key.owner, {}, {.bytes = old->bytes});
  for (const ObjectPart& part : old->data->parts) {
    if (const InstanceRef* child = InstanceOf(part.content)) {
      next_.uses.Erase({key.owner, child->object, true, key.name, ""});
    }
  }
  next_.objects.Erase(key);
}

void Draft::RebaseLayer(const OwnedName& key, const LayerPtr& was, const LayerPtr* is,
                        bool edited) {
  if (FindLayer(key) == nullptr) return;  // this draft has removed the layer
  if (!edited && is == nullptr) return RemoveLayer(key);
  const EntityMap none;
  std::vector<std::string> removed;
  EntityMap::Diff(was->entities, is == nullptr ? none : (*is)->entities,
                  [&](const std::string& id, const EntityPtr* before, const EntityPtr*) {
                    const EntityPtr* mine = FindEntity(key, id);
                    if (before != nullptr && mine != nullptr && *mine == *before) {
                      removed.push_back(id);
                    }
                  });
  for (const std::string& id : removed) RemoveEntity(key, id);
  if (is == nullptr) return;
  Layer& layer = OpenLayer(key);
  layer.suppressed = (*is)->suppressed;
  if (!edited) layer.writer = (*is)->writer;
}

void Draft::Rebase(const SnapshotPtr& now, uint64_t owner, const std::set<std::string>& edited) {
  const auto take = [](auto& map, const auto& key, const auto* value) {
    if (value != nullptr) {
      map.Put(key, *value);
    } else {
      map.Erase(key);
    }
  };
  const auto tally_in = [owner](const Snapshot& snapshot) {
    const OwnerTally* found = snapshot.owners.Find(owner);
    return found == nullptr ? OwnerTally() : *found;
  };
  const SnapshotPtr was = std::exchange(base_, now);
  tally(owner);  // caches the tally of the old base unless this draft has changed it

  // Apply the changes of other owners.
  const OwnerTally own_was = tally_in(*was), own_is = tally_in(*now);
  for (const auto of :
       {&OwnerTally::drawables, &OwnerTally::layers, &OwnerTally::bytes, &OwnerTally::derived}) {
    next_.total.*of += (now->total.*of - own_is.*of) - (was->total.*of - own_was.*of);
  }
  next_.entities += now->entities - was->entities;
  decltype(next_.objects)::Diff(was->objects, now->objects,
                                [&](const OwnedName& key, const ObjectPtr*, const ObjectPtr* is) {
                                  if (key.owner != owner) take(next_.objects, key, is);
                                });
  decltype(next_.uses)::Diff(was->uses, now->uses,
                             [&](const UseKey& key, const bool*, const bool* is) {
                               if (key.owner != owner) take(next_.uses, key, is);
                             });
  decltype(next_.expiries)::Diff(
      was->expiries, now->expiries,
      [&](const ExpiryKey& key, const EntityPlace* before, const EntityPlace* is) {
        const EntityPlace& place = before != nullptr ? *before : *is;
        if (place.layer.owner != owner) take(next_.expiries, key, is);
      });
  decltype(next_.owners)::Diff(was->owners, now->owners,
                               [&](uint64_t key, const OwnerTally*, const OwnerTally* is) {
                                 if (key != owner) take(next_.owners, key, is);
                               });
  decltype(next_.layers)::Diff(
      was->layers, now->layers,
      [&](const OwnedName& key, const LayerPtr* before, const LayerPtr* is) {
        if (key.owner != owner) return take(next_.layers, key, is);
        const uint64_t held = is == nullptr ? 0 : (*is)->entities.size();
        next_.entities += (*before)->entities.size() - held;  // RemoveEntity subtracts these
        RebaseLayer(key, *before, is, edited.contains(key.name));
      });
}

void Draft::Suppress(uint64_t owner, bool suppressed) {
  for (auto& [key, layer] : open_) {
    if (key.owner == owner && layer.has_value()) layer->suppressed = suppressed;
  }
}

OwnerTally Draft::Growth() const {
  OwnerTally growth;
  for (const auto of :
       {&OwnerTally::drawables, &OwnerTally::layers, &OwnerTally::bytes, &OwnerTally::derived}) {
    if (next_.total.*of > base_->total.*of) growth.*of = next_.total.*of - base_->total.*of;
  }
  return growth;
}

SnapshotPtr Draft::Finish(uint64_t number) && {
  for (auto& [key, layer] : open_) {
    if (layer.has_value()) {
      next_.layers.Put(key, std::make_shared<const Layer>(*std::move(layer)));
    } else {
      next_.layers.Erase(key);
    }
  }
  for (const auto& [owner, tally] : tallies_) {
    if (tally == OwnerTally()) {
      next_.owners.Erase(owner);
    } else {
      next_.owners.Put(owner, tally);
    }
  }
  next_.number = number;
  return std::make_shared<const Snapshot>(std::move(next_));
}

}  // namespace voxeld::daemon
