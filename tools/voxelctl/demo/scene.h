// The scenes of the demo, made from files or by code.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/data_files.h"
#include "tools/voxelctl/demo/stage.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {

// A scene that can be shown. Used by one thread at a time.
class Scene {
 public:
  virtual ~Scene() = default;
  // Stages the whole scene in its initial state, replacing what was on the stage.
  virtual absl::Status Begin(Stage& stage) = 0;
  // Stages what has changed `seconds` after the beginning. Called more than 20 times a second if
  // the displays keep up.
  virtual absl::Status Move(Stage& stage, double seconds) = 0;
};

struct SceneSettings {
  DisplaySpace space;              // the space for it
  int least_side = 128;            // number of voxels of the display's shortest axis
  std::vector<std::string> files;  // the files of SceneAbout::needs, in that order
};

struct SceneAbout {
  const char* name;
  const char* seen;    // description of the scene
  const char* source;  // origin of its data
  std::vector<SceneFile> needs;
  bool needs_importers;  // reads a format that VOXELD_IMPORTERS adds
  // Reads and computes everything that takes time; may run on any thread. Errors concern the files.
  absl::StatusOr<std::unique_ptr<Scene>> (*make)(const SceneSettings& settings);
};

// Returns the scenes in the order and with the names of kSceneNames.
std::span<const SceneAbout> Scenes();

// Returns: the files of SceneAbout::needs. Errors: Unimplemented with the option that adds what the
// scene needs, if this build lacks it; NotFound with how to get the first missing file.
absl::StatusOr<std::vector<std::string>> FindWhatSceneNeeds(const SceneAbout& scene,
                                                            const std::vector<std::string>& roots);

}  // namespace voxeld::voxelctl
