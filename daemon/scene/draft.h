// A snapshot in the making. Keeps every index of the scene (uses of objects, expiries, tallies,
// bounds) in step with each change; checks nothing that a client may get wrong, quotas included:
// that is CommitApplier's.
//
// A draft of one owner's changes can be in the making while others publish snapshots: Rebase puts its changes on top
// of theirs.
//
// Single-threaded. Dropping a draft undoes it.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

class Draft {
 public:
  // `next_number` gives unique numbers to entities and layers;
  // it lives as long as the draft and is never set back.
  Draft(SnapshotPtr base, uint64_t& next_number);

  const Snapshot& base() const { return *base_; }

  // ---- reading, changes of this draft included. Pointers hold until the next change.
  const Layer* FindLayer(const OwnedName& key) const;
  const EntityPtr* FindEntity(const OwnedName& layer, const std::string& id) const;
  const Object* FindObject(const OwnedName& key) const { return next_.FindObject(key); }
  const OwnerTally& tally(uint64_t owner) const;
  const OwnerTally& total() const { return next_.total; }
  const PersistentMap<UseKey, bool>& uses() const { return next_.uses; }
  const PersistentMap<ExpiryKey, EntityPlace>& expiries() const { return next_.expiries; }
  // fn(key, layer) for every layer there is, in no particular order.
  // `fn` must not change the draft.
  template <typename Fn>
  void ForEachLayer(Fn&& fn) const {
    next_.layers.ForEach([&](const OwnedName& key, const LayerPtr&) {
      if (const Layer* layer = FindLayer(key)) fn(key, *layer);
    });
    for (const auto& [key, layer] : open_) {
      if (layer.has_value() && !next_.layers.Contains(key)) fn(key, *layer);
    }
  }
  // Primitives that an entity of this content draws; at least 1. The object must exist.
  uint64_t DrawablesOf(uint64_t owner, const Content& content) const;
  // Bytes that an engine derives from such an entity at most. The object must exist.
  uint64_t DerivedBytesOf(uint64_t owner, const Content& content) const;
  Bounds BoundsOf(uint64_t owner, const Content& content) const;

  // ---- layers
  // Finds or makes it.
  Layer& EditLayer(const OwnedName& key, const WriterPtr& writer);
  // With all that it holds. It must exist.
  void RemoveLayer(const OwnedName& key);
  // All entities of the layer, which must exist.
  void ClearLayer(const OwnedName& key);

  // ---- entities. The layer must exist.
  // What counts against max_bytes_per_owner and max_scene_bytes.
  static uint64_t LayerBytes(const OwnedName& layer) { return sizeof(Layer) + layer.name.size(); }
  static uint64_t EntityBytes(const OwnedName& layer, const std::string& id,
                              const EntityData& data);
  static uint64_t ObjectBytes(const std::string& name, const ObjectData& data);
  // Fills in `bytes`; gives a number unless there is one already
  // (an entity of the same key keeps its own).
  void PutEntity(const OwnedName& layer, const std::string& id, Entity entity);
  void RemoveEntity(const OwnedName& layer, const std::string& id);

  // ---- objects
  // `object` complete with what is derived; its objects exist. Objects that refer to it are not
  // touched: put them too where what is derived changes.
  void PutObject(const OwnedName& key, Object object);
  // No entity refers to it any more, and no object.
  void RemoveObject(const OwnedName& key);

  // Replaces the base by `now`, a later snapshot. Requires that this draft changes only `owner`, and that `now` differs from
  // the base only in other owners, except that entities and layers of `owner` may have been removed, and its layers
  // hidden or given another writer. An entity of `owner` that was removed stays if this draft has replaced it. A
  // layer of `owner` that was removed stays if `edited` has its name: the layers that this draft changes. Costs as
  // much as there are differences between the base and `now`.
  void Rebase(const SnapshotPtr& now, uint64_t owner, const std::set<std::string>& edited);
  // Hides or shows the layers of `owner` that this draft has changed.
  void Suppress(uint64_t owner, bool suppressed);
  // Returns: how much the draft adds to each total of its base; 0 for a total that it reduces.
  OwnerTally Growth() const;

  // The finished snapshot. The draft is spent.
  SnapshotPtr Finish(uint64_t number) &&;

 private:
  // Adds `more` to the owner's tally and to the total, and takes `less` away.
  void Count(uint64_t owner, const OwnerTally& more, const OwnerTally& less);
  // Returns: what an entity of this layer counts against quotas.
  OwnerTally CountOf(const OwnedName& layer, const Entity& entity) const;
  Layer& OpenLayer(const OwnedName& key);
  // The part of Rebase for one layer of the draft's owner, which was `was` in the old base and is `is` (null: removed) in
  // the new one.
  void RebaseLayer(const OwnedName& key, const LayerPtr& was, const LayerPtr* is, bool edited);
  void Index(const OwnedName& layer, const std::string& id, const Entity& entity);
  void Unindex(const OwnedName& layer, const std::string& id, const Entity& entity);

  SnapshotPtr base_;
  uint64_t& next_number_;
  Snapshot next_;
  // Layers and tallies under change, put into next_ when finished; nullopt: removed.
  std::map<OwnedName, std::optional<Layer>> open_;
  mutable std::map<uint64_t, OwnerTally> tallies_;
};

// Bytes that count against max_bytes_per_owner.
uint64_t BytesOf(const Content& content);
// Saturating.
uint64_t AddSaturating(uint64_t a, uint64_t b);

}  // namespace voxeld::daemon
