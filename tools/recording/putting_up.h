// What has to be sent so that a daemon's scene becomes what a recording says, change set by change set.
//
// All that was recorded becomes one client's: a layer goes by its name behind a prefix ("night: map"), and by a number
// where there are several of that name at once ("night: map (2)"); an object by its owner and name. So whatever several
// had stays apart. Layers are made in the order of their numbers, as they blend by it.
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
  // `prefix`: of all layers' names in the daemon's scene.
  explicit PuttingUp(std::string prefix = "") : prefix_(std::move(prefix)) {}

  // The requests of one commit that leads from what was put up to `changes`, a change set in one message.
  std::vector<v1::StreamRequest> Step(const v1::WatchSceneResponse& changes);

  // Only remembers: what it leads to is in the next Whole.
  void Skip(const v1::WatchSceneResponse& changes) { mirror_.Apply(changes); }
  // All of it, for a scene that has nothing of it yet.
  std::vector<v1::StreamRequest> Whole();

  // Layers that have been emptied since this was asked last, and can be removed.
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
  // Those that `changes` removes: whichever has others as parts before these.
  std::vector<ObjectName> InOrderOfLeaving(const v1::WatchSceneResponse& changes) const;
  // Masks go by names, and a mask's layer may have become another.
  void PutMasks(std::vector<v1::StreamRequest>* out);

  const std::string prefix_;
  SceneMirror mirror_;
  // The daemon's names, by owner, layer and number; and the same, none of them twice.
  std::map<std::tuple<uint64_t, std::string, uint64_t>, std::string> names_;
  std::set<std::string> taken_;
  std::map<LayerName, std::string> masks_;  // as they were put up last
  std::vector<std::string> emptied_;
};

}  // namespace voxeld::recording
