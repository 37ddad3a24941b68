// Maintains the state of a watched scene from its change sets, for users that need more than the
// changes.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "voxeld/v1/scene.pb.h"

namespace voxeld::recording {

struct LayerName {
  uint64_t owner = 0;
  std::string layer;
  auto operator<=>(const LayerName&) const = default;
};

struct EntityName {
  LayerName layer;
  std::string id;
  auto operator<=>(const EntityName&) const = default;
};

class SceneMirror {
 public:
  // Applies a message's parts in their defined order.
  void Apply(const v1::WatchSceneResponse& message);

  const std::map<LayerName, v1::LayerInfo>& layers() const { return layers_; }
  const std::map<EntityName, v1::WatchedEntity>& entities() const { return entities_; }
  const std::map<std::pair<uint64_t, std::string>, v1::Object>& objects() const { return objects_; }
  const v1::Object* FindObject(uint64_t owner, const std::string& name) const;

  // Entities that look different from the previous call, because of themselves, their layer or an
  // object; and entities that were removed or are now invisible.
  struct Changes {
    std::set<EntityName> changed, gone;
  };
  Changes TakeChanges();

 private:
  void Touch(const LayerName& layer);

  std::map<LayerName, v1::LayerInfo> layers_;
  std::map<EntityName, v1::WatchedEntity> entities_;
  std::map<std::pair<uint64_t, std::string>, v1::Object> objects_;
  Changes changes_;
};

}  // namespace voxeld::recording
