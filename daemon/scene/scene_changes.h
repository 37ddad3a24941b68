// Reports the differences of two snapshots in pieces, for clients that watch the scene.
//
//   SceneChanges changes(filter, before, after);
//   while (!changes.Next(visitor)) …            // each call resumes where the last one stopped
//
// The walk holds the two snapshots and a position in them. Its memory does not grow with the
// differences; its cost depends on them only. Objects come first, so that instances find theirs.
// Layers follow in ascending order of (owner, name), each with its entities in ascending order of
// id. Applied in this order, the changes turn `before` into `after`.
//
// Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

struct SceneFilter {
  uint64_t owner = 0;    // 0: all owners
  std::string layer;     // empty: all layers
  bool objects = false;  // include the owner's objects, whatever the layer
};

// Each function returns whether there is room for more. If not, Next returns; that change counts as
// reported.
class SceneChangeVisitor {
 public:
  virtual ~SceneChangeVisitor() = default;
  // The object is new or has another definition.
  virtual bool OnObject(const OwnedName& key, const Object& object) = 0;
  virtual bool OnRemovedObject(const OwnedName& key) = 0;
  // The layer is new, or changed in anything but its entities and counts. A recreated layer is
  // first reported as removed.
  virtual bool OnLayer(const OwnedName& key, const Layer& layer) = 0;
  // The layer was removed with all its entities.
  virtual bool OnRemovedLayer(const OwnedName& key) = 0;
  // The entity is new, replaced or moved. Its layer has been reported before.
  virtual bool OnEntity(const OwnedName& layer, const std::string& id, const Entity& entity) = 0;
  virtual bool OnRemovedEntity(const OwnedName& layer, const std::string& id) = 0;
};

class SceneChanges {
 public:
  // `before` null means the empty scene.
  SceneChanges(SceneFilter filter, SnapshotPtr before, SnapshotPtr after);

  // Reports changes until `visitor` has no room. Returns: true at the end, and on every later call.
  bool Next(SceneChangeVisitor& visitor);

 private:
  bool TellObjects(SceneChangeVisitor& visitor);
  bool TellLayers(SceneChangeVisitor& visitor);
  bool TellLayer(const OwnedName& key, const Layer* was, const Layer* is,
                 SceneChangeVisitor& visitor);
  bool TellEntities(const Layer* was, const Layer& is, SceneChangeVisitor& visitor);
  bool Matches(const OwnedName& key) const;

  const SceneFilter filter_;
  const SnapshotPtr before_, after_;

  // The position: everything before it has been reported.
  bool objects_told_ = false;
  OwnedName from_;                   // the next object or layer, or one before it
  std::optional<OwnedName> inside_;  // the layer whose entities are being reported
  std::string entity_from_;          // the next entity, or one before it
};

// Returns the size of the change from `before` to `after`, by owner: 1 for a small entity that is put, moved or removed,
// more for a large one. It stands for the work of an engine. Counting stops at `most` for each owner, which bounds the
// cost. Owners in `skip` are left out.
std::map<uint64_t, uint64_t> ChangesByOwner(const Snapshot& before, const Snapshot& after,
                                            uint64_t most, const std::set<uint64_t>& skip = {});

// Returns `scene` with these owners' layers and objects replaced by those of `part`; whether an operator hides a layer is
// as in `scene`. The result is for drawing only: what is not drawn (uses of objects, expiries, the number of entities) is
// that of `scene`.
SnapshotPtr WithPartsOf(const Snapshot& scene, const Snapshot& part,
                        const std::set<uint64_t>& owners);

}  // namespace voxeld::daemon
