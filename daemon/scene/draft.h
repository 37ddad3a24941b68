// A snapshot under construction. Keeps every index of the scene (uses of objects, expiries,
// tallies, bounds) consistent with each change. It validates nothing, not even quotas:
// CommitApplier does.
//
// A draft of one owner's changes can exist while other owners publish snapshots: Rebase applies its
// changes on top of theirs.
//
// Single-threaded. Destroying a draft discards it.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

class Draft {
 public:
  // `next_number` supplies unique numbers for entities and layers. It must outlive the draft and
  // never decrease.
  Draft(SnapshotPtr base, uint64_t& next_number);

  const Snapshot& base() const { return *base_; }

  // ---- queries, including this draft's changes. Pointers are valid until the next change.
  const Layer* FindLayer(const OwnedName& key) const;
  const EntityPtr* FindEntity(const OwnedName& layer, const std::string& id) const;
  const Object* FindObject(const OwnedName& key) const { return next_.FindObject(key); }
  const OwnerTally& tally(uint64_t owner) const;
  const OwnerTally& total() const { return next_.total; }
  const PersistentMap<UseKey, bool>& uses() const { return next_.uses; }
  const PersistentMap<ExpiryKey, EntityPlace>& expiries() const { return next_.expiries; }
  // Calls fn(key, layer) for every layer, in no particular order. `fn` must not change the draft.
  template <typename Fn>
  void ForEachLayer(Fn&& fn) const {
    next_.layers.ForEach([&](const OwnedName& key, const LayerPtr&) {
      if (const Layer* layer = FindLayer(key)) fn(key, *layer);
    });
    for (const auto& [key, layer] : open_) {
      if (layer.has_value() && !next_.layers.Contains(key)) fn(key, *layer);
    }
  }
  // Returns: the number of primitives that an entity with this content draws; at least 1. Requires:
  // the object exists.
  uint64_t DrawablesOf(uint64_t owner, const Content& content) const;
  // Returns: the maximum of bytes that an engine derives from such an entity. Requires: the object
  // exists.
  uint64_t DerivedBytesOf(uint64_t owner, const Content& content) const;
  Bounds BoundsOf(uint64_t owner, const Content& content) const;

  // ---- layers
  // Finds or creates the layer.
  Layer& EditLayer(const OwnedName& key, const WriterPtr& writer);
  // Removes the layer with all entities. Requires: it exists.
  void RemoveLayer(const OwnedName& key);
  // Removes all entities of the layer. Requires: it exists.
  void ClearLayer(const OwnedName& key);

  // ---- entities. The layer must exist.
  // Returns: the bytes that count against max_bytes_per_owner and max_scene_bytes.
  static uint64_t LayerBytes(const OwnedName& layer) { return sizeof(Layer) + layer.name.size(); }
  static uint64_t EntityBytes(const OwnedName& layer, const std::string& id,
                              const EntityData& data);
  static uint64_t ObjectBytes(const std::string& name, const ObjectData& data);
  // Sets `bytes`, and a number unless there is one already (an entity with the same key keeps its
  // number).
  void PutEntity(const OwnedName& layer, const std::string& id, Entity entity);
  void RemoveEntity(const OwnedName& layer, const std::string& id);

  // ---- objects
  // Requires: `object` includes its derived values, and the objects that it refers to exist. Does
  // not update objects that refer to it: put them too if their derived values change.
  void PutObject(const OwnedName& key, Object object);
  // Requires: no entity or object refers to it.
  void RemoveObject(const OwnedName& key);

  // Replaces the base by `now`, a later snapshot. Requires: this draft changes only `owner`. `now`
  // differs from the base only in other owners, except that entities and layers of `owner` may have
  // been removed, and its layers may have been hidden or given another writer. An entity of `owner`
  // that was removed stays if this draft has replaced it. A layer of `owner` that was removed stays
  // if its name is in `edited`, the layers that this draft changes. Costs as much as there are
  // differences between the base and `now`.
  void Rebase(const SnapshotPtr& now, uint64_t owner, const std::set<std::string>& edited);
  // Hides or shows the layers of `owner` that this draft has changed.
  void Suppress(uint64_t owner, bool suppressed);
  // Returns: how much the draft adds to each total of its base; 0 for a total that it reduces.
  OwnerTally Growth() const;

  // Returns: the finished snapshot. The draft must not be used afterwards.
  SnapshotPtr Finish(uint64_t number) &&;

 private:
  // Adds `more` to the owner's tally and to the total, and subtracts `less`.
  void Count(uint64_t owner, const OwnerTally& more, const OwnerTally& less);
  // Returns: how an entity of this layer counts against quotas.
  OwnerTally CountOf(const OwnedName& layer, const Entity& entity) const;
  Layer& OpenLayer(const OwnedName& key);
  // Does Rebase for one layer of the draft's owner. `was` is the layer in the old base, `is` (null:
  // removed) in the new one.
  void RebaseLayer(const OwnedName& key, const LayerPtr& was, const LayerPtr* is, bool edited);
  void Index(const OwnedName& layer, const std::string& id, const Entity& entity);
  void Unindex(const OwnedName& layer, const std::string& id, const Entity& entity);

  SnapshotPtr base_;
  uint64_t& next_number_;
  Snapshot next_;
  // Changed layers and tallies, moved to next_ by Finish; nullopt: removed.
  std::map<OwnedName, std::optional<Layer>> open_;
  mutable std::map<uint64_t, OwnerTally> tallies_;
};

// Returns: the bytes that count against max_bytes_per_owner.
uint64_t BytesOf(const Content& content);
// Adds, saturating.
uint64_t AddSaturating(uint64_t a, uint64_t b);

}  // namespace voxeld::daemon
