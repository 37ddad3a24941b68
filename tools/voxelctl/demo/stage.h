// The stage of a scene: one layer of a session, and the objects that are drawn in it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "tools/voxelctl/connection/scene_session.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/scene/volume.h"
#include "voxeld/client.h"

namespace voxeld::voxelctl {

class Stage {
 public:
  // `session` must outlive the stage. Objects' names begin with `prefix`.
  Stage(SceneSession& session, client::Layer layer, std::string prefix)
      : session_(session), layer_(std::move(layer)), prefix_(std::move(prefix)) {}

  const client::Layer& layer() const { return layer_; }

  // Defines an object, which instances refer to by ObjectName(name). A model must be placed and
  // coloured. If the limits require several commits, earlier ones are committed here; nothing is
  // visible yet.
  absl::Status Define(const std::string& name, const Model& model, const VolumeLook& look = {});
  absl::Status Define(const std::string& name, std::vector<client::Part> parts);
  std::string ObjectName(const std::string& name) const;

  // Stages the removal of all objects that were defined here, the last first.
  absl::Status RemoveObjects();

 private:
  absl::Status Put(const std::string& object, std::vector<client::Part> parts, uint64_t bytes);

  SceneSession& session_;
  client::Layer layer_;
  const std::string prefix_;
  std::vector<std::string> objects_;
};

}  // namespace voxeld::voxelctl
