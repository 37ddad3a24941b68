// Computes the requests that make a daemon's scene match a recording, change set by change set.
//
// Everything in the recording becomes the property of one client: a layer is named by its name
// after a prefix ("night: map"), with a number if several have that name at the same time ("night:
// map (2)"); an object is named by its owner and name. So the contents of different owners stay
// separate. Layers are created in the order of their numbers, because they blend in that order.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tools/recording/scene_mirror.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::recording {

// Not thread-safe.
class PuttingUp {
 public:
  // `prefix` is put before all layers' names in the daemon's scene.
  explicit PuttingUp(std::string prefix = "") : prefix_(std::move(prefix)) {}

  // Returns the requests of one commit that leads from the current state to `changes`, which is a
  // change set in one message.
  std::vector<v1::StreamRequest> Step(const v1::WatchSceneResponse& changes);

  // Records the changes only: the next Whole() includes them.
  void Skip(const v1::WatchSceneResponse& changes) { mirror_.Apply(changes); }
  // Returns the requests for the whole state, for a scene that contains nothing of it yet.
  std::vector<v1::StreamRequest> Whole();

  // Returns the layers that have been emptied since the previous call and can be removed.
  std::vector<std::string> TakeEmptied();

 private:
  using ObjectName = std::pair<uint64_t, std::string>;  // owner, object

  std::string NameOf(const LayerName& layer);  // in the daemon's scene
  static std::string ObjectOf(uint64_t owner, const std::string& name);
  static void Rename(uint64_t owner, v1::Primitive* primitive);
  void PutLayers(std::vector<v1::LayerInfo> layers, std::vector<v1::StreamRequest>* out);
  void PutObjects(const std::map<ObjectName, v1::Object>& objects,
                  std::vector<v1::StreamRequest>* out) const;
  void PutEntity(const v1::WatchedEntity& entity, std::vector<v1::StreamRequest>* out);
  // Returns the objects that `changes` removes, each before its parts.
  std::vector<ObjectName> InOrderOfLeaving(const v1::WatchSceneResponse& changes) const;
  // Masks refer to layers by name, and the layer of a mask may have changed.
  void PutMasks(std::vector<v1::StreamRequest>* out);

  const std::string prefix_;
  SceneMirror mirror_;
  // The daemon's names, by owner, layer and number; and the set of these names, which are unique.
  std::map<std::tuple<uint64_t, std::string, uint64_t>, std::string> names_;
  std::set<std::string> taken_;
  std::map<LayerName, std::string> masks_;  // as they were last sent
  std::vector<std::string> emptied_;
};

}  // namespace voxeld::recording
