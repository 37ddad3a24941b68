#include "tests/daemon/scene/store_fixture.h"

#include <algorithm>
#include <functional>
#include <map>
#include <set>

#include "gpu/derived_bytes.h"

namespace voxeld::daemon::testing {

std::string CheckIndices(const Snapshot& snapshot) {
  std::string wrong;
  std::set<UseKey> uses;
  std::map<ExpiryKey, EntityPlace> expiries;
  std::map<uint64_t, OwnerTally> owners;
  uint64_t entities = 0;

  const std::function<uint64_t(uint64_t, const Content&)> drawables =
      [&](uint64_t owner, const Content& content) -> uint64_t {
    const auto* instance = std::get_if<InstanceRef>(&content);
    if (instance == nullptr) return 1;
    const Object* object = snapshot.FindObject({owner, instance->object});
    if (object == nullptr) {
      wrong += "an instance of an object that is not there: " + instance->object + "\n";
      return 1;
    }
    uint64_t sum = 0;
    for (const ObjectPart& part : object->data->parts) sum += drawables(owner, part.content);
    if (sum != object->drawables) wrong += "drawables of " + instance->object + "\n";
    return sum;
  };

  const std::function<uint64_t(uint64_t, const Content&)> derived =
      [&](uint64_t owner, const Content& content) -> uint64_t {
    const auto of = [](const GeometryPtr& geometry) {
      return kHeldBytesPerDrawable + gpu::MostDerivedBytes(geometry->record);
    };
    uint64_t sum = 0;
    if (const auto* geometry = std::get_if<GeometryPtr>(&content)) return of(*geometry);
    if (const auto* group = std::get_if<GroupPtr>(&content)) {
      for (const GroupData::Part& part : (*group)->parts) sum += of(part.geometry);
      return sum;
    }
    const Object* object = snapshot.FindObject({owner, std::get<InstanceRef>(content).object});
    if (object == nullptr) return 0;  // reported above
    for (const ObjectPart& part : object->data->parts) sum += derived(owner, part.content);
    if (sum != object->derived) wrong += "bytes derived from an object\n";
    return sum;
  };

  snapshot.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    ++owners[key.owner].layers;
    owners[key.owner].bytes += sizeof(Layer) + key.name.size();
    uint64_t bytes = 0;
    layer->entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      ++entities;
      bytes += entity->bytes;
      owners[key.owner].bytes += entity->bytes;
      owners[key.owner].drawables +=
          std::max<uint64_t>(1, drawables(key.owner, entity->data.content));
      owners[key.owner].derived += derived(key.owner, entity->data.content);
      if (const auto* instance = std::get_if<InstanceRef>(&entity->data.content)) {
        uses.insert({key.owner, instance->object, false, key.name, id});
      }
      if (entity->expires_ns != sync::kNever) {
        expiries[{entity->expires_ns, entity->number}] = {key, id};
      }
    });
    if (bytes != layer->bytes) wrong += "bytes of layer " + key.name + "\n";
  });
  snapshot.objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    owners[key.owner].bytes += object->bytes;
    drawables(key.owner, InstanceRef{key.name});
    for (const ObjectPart& part : object->data->parts) {
      if (const auto* child = std::get_if<InstanceRef>(&part.content)) {
        uses.insert({key.owner, child->object, true, key.name, ""});
      }
    }
  });

  std::set<UseKey> held_uses;
  snapshot.uses.ForEach([&](const UseKey& use, bool) { held_uses.insert(use); });
  std::map<ExpiryKey, EntityPlace> held_expiries;
  snapshot.expiries.ForEach(
      [&](const ExpiryKey& key, const EntityPlace& place) { held_expiries[key] = place; });
  std::map<uint64_t, OwnerTally> held_owners;
  snapshot.owners.ForEach(
      [&](uint64_t owner, const OwnerTally& tally) { held_owners[owner] = tally; });
  if (uses != held_uses) wrong += "uses\n";
  if (expiries != held_expiries) wrong += "expiries\n";
  if (owners != held_owners) wrong += "owners\n";
  OwnerTally total;
  for (const auto& [owner, tally] : owners) {
    total.drawables += tally.drawables;
    total.layers += tally.layers;
    total.bytes += tally.bytes;
    total.derived += tally.derived;
  }
  if (total != snapshot.total) wrong += "total\n";
  if (entities != snapshot.entities) wrong += "entities\n";
  return wrong;
}

}  // namespace voxeld::daemon::testing
