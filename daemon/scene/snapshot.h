// The immutable scene at one moment, from which every display draws and every query reads.
//
// Snapshots share common parts, so a snapshot costs what has changed since the previous one, and a
// difference of two costs what differs.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "daemon/scene/bounds.h"
#include "daemon/scene/operation.h"
#include "daemon/scene/persistent_map.h"
#include "display/sync/clock.h"

namespace voxeld::daemon {

// The session that last wrote a layer.
struct Writer {
  uint64_t session = 0;
  std::string client_name;
  bool ended = false;  // its layers are orphaned
  bool keep = false;   // its layers outlive it and the daemon
  bool operator==(const Writer&) const = default;
};
using WriterPtr = std::shared_ptr<const Writer>;

// Owner and name of a layer or an object.
struct OwnedName {
  uint64_t owner = 0;
  std::string name;
  auto operator<=>(const OwnedName&) const = default;
  template <typename H>
  friend H AbslHashValue(H h, const OwnedName& k) {
    return H::combine(std::move(h), k.owner, k.name);
  }
};

struct Entity {
  EntityData data;
  uint64_t number = 0;    // unique in the store; stays when an entity with the same key is replaced
  uint64_t sequence = 0;  // of the last upsert
  sync::TimeNs expires_ns = sync::kNever;
  uint64_t bytes = 0;
};
using EntityPtr = std::shared_ptr<const Entity>;
using EntityMap = PersistentMap<std::string, EntityPtr>;

struct Layer {
  uint64_t number = 0;  // assigned on creation; also the engine's id
  bool visible = true;
  bool suppressed = false;  // its owner is hidden by an operator
  uint32_t opacity = 255;
  int32_t order = 0;
  gpu::BlendMode blend = gpu::BlendMode::kOver;
  gpu::Affine transform;
  Clip clip;
  std::optional<gpu::Region> region;
  std::string mask;  // a layer of the same owner, which may not exist; empty: none
  bool shown() const { return visible && !suppressed; }
  WriterPtr writer;
  EntityMap entities;
  uint64_t bytes = 0;
  // Contains every entity, in the layer's coordinates; may be too wide after removals.
  Bounds bounds;
};
using LayerPtr = std::shared_ptr<const Layer>;

struct Object {
  std::shared_ptr<const ObjectData> data;
  uint64_t bytes = 0;
  // Derived from the definition and the objects that it refers to.
  uint32_t depth = 1;      // 1: no instances inside
  uint64_t drawables = 0;  // primitives that one instance draws; saturates
  uint64_t derived = 0;    // maximum of bytes that one engine derives from one instance; saturates
  Bounds bounds;           // in the object's coordinates
};
using ObjectPtr = std::shared_ptr<const Object>;

// A reference to an object: from an entity (layer, id), or from another object (its name in
// `layer`, no id).
struct UseKey {
  uint64_t owner = 0;
  std::string object;
  bool by_object = false;
  std::string layer, id;
  auto operator<=>(const UseKey&) const = default;
  template <typename H>
  friend H AbslHashValue(H h, const UseKey& k) {
    return H::combine(std::move(h), k.owner, k.object, k.by_object, k.layer, k.id);
  }
};

struct ExpiryKey {
  sync::TimeNs time_ns = 0;
  uint64_t entity = 0;  // number of the entity
  auto operator<=>(const ExpiryKey&) const = default;
  template <typename H>
  friend H AbslHashValue(H h, const ExpiryKey& k) {
    return H::combine(std::move(h), k.time_ns, k.entity);
  }
};

struct EntityPlace {
  OwnedName layer;
  std::string id;
  auto operator<=>(const EntityPlace&) const = default;
};

// Memory for each drawable in addition to what engines derive: the index of an engine's content,
// and temporarily the delta that updates it.
inline constexpr uint64_t kHeldBytesPerDrawable = 800;

// Amounts that count against quotas, for one owner or for all together.
struct OwnerTally {
  uint64_t drawables = 0;  // entities; an instance counts as many as it draws (at least 1)
  uint64_t layers = 0;
  uint64_t bytes = 0;
  uint64_t derived = 0;  // maximum that each engine derives from them (MostDerivedBytes)
  bool operator==(const OwnerTally&) const = default;
};

struct Snapshot {
  uint64_t number = 0;  // ascending; 0: not from a store
  PersistentMap<OwnedName, LayerPtr> layers;
  PersistentMap<OwnedName, ObjectPtr> objects;
  PersistentMap<UseKey, bool> uses;
  PersistentMap<ExpiryKey, EntityPlace> expiries;
  PersistentMap<uint64_t, OwnerTally> owners;
  OwnerTally total;  // of all owners
  uint64_t entities = 0;

  const Layer* FindLayer(const OwnedName& key) const {
    const LayerPtr* layer = layers.Find(key);
    return layer == nullptr ? nullptr : layer->get();
  }
  const Object* FindObject(const OwnedName& key) const {
    const ObjectPtr* object = objects.Find(key);
    return object == nullptr ? nullptr : object->get();
  }
  EntityPtr FindEntity(const OwnedName& layer, const std::string& id) const {
    const Layer* l = FindLayer(layer);
    const EntityPtr* entity = l == nullptr ? nullptr : l->entities.Find(id);
    return entity == nullptr ? nullptr : *entity;
  }
};
using SnapshotPtr = std::shared_ptr<const Snapshot>;

}  // namespace voxeld::daemon
