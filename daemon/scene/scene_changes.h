// What differs between any two snapshots, told piece by piece: for those who watch the scene.
//
//   SceneChanges changes(filter, before, after);
//   while (!changes.Next(visitor)) …            // each call goes on where the last one stopped
//
// The walk holds the two snapshots and a place in them, and nothing that grows with what differs;
// its cost is of what differs. Objects come first, so that instances find theirs; then layer by
// layer, in ascending order of (owner, name), each with its entities in ascending order of id.
// Applied in the order in which they come, the changes make `before` into `after`.
//
// Single-threaded.
#pragma once

#include <optional>
#include <string>

#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

struct SceneFilter {
  uint64_t owner = 0;    // 0: all
  std::string layer;     // empty: all
  bool objects = false;  // of the owner, whatever the layer
};

// Each answers whether there is room for more; if not, Next returns, and that change has been told.
class SceneChangeVisitor {
 public:
  virtual ~SceneChangeVisitor() = default;
  // New, or another definition.
  virtual bool OnObject(const OwnedName& key, const Object& object) = 0;
  virtual bool OnRemovedObject(const OwnedName& key) = 0;
  // New, or changed in anything but its entities and counts. A layer that was removed and made
  // again is told as removed first.
  virtual bool OnLayer(const OwnedName& key, const Layer& layer) = 0;
  // With all that it held.
  virtual bool OnRemovedLayer(const OwnedName& key) = 0;
  // New, or replaced, or moved. Its layer has been told.
  virtual bool OnEntity(const OwnedName& layer, const std::string& id, const Entity& entity) = 0;
  virtual bool OnRemovedEntity(const OwnedName& layer, const std::string& id) = 0;
};

class SceneChanges {
 public:
  // `before` null: the empty scene.
  SceneChanges(SceneFilter filter, SnapshotPtr before, SnapshotPtr after);

  // Tells until `visitor` has no room, or to the end: then true, and from then on.
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

  // The place: everything before it has been told.
  bool objects_told_ = false;
  OwnedName from_;                   // the next object or layer, or one before it
  std::optional<OwnedName> inside_;  // the layer whose entities are being told
  std::string entity_from_;          // the next of them, or one before it
};

}  // namespace voxeld::daemon
