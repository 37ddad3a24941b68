// What the demo plays: scenes, made of files or by code.
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

// One that can be put up. Used by one thread at a time.
class Scene {
 public:
  virtual ~Scene() = default;
  // Stages all of it, as it is at its beginning, in place of what was on the stage.
  virtual absl::Status Begin(Stage& stage) = 0;
  // Stages what has changed `seconds` after the beginning; more than 20 times a second where the displays keep up.
  virtual absl::Status Move(Stage& stage, double seconds) = 0;
};

struct SceneSettings {
  DisplaySpace space;              // what is to hold it
  int least_side = 128;            // voxels, of the display that has the fewest along an axis
  std::vector<std::string> files;  // of SceneAbout::needs, in that order
};

struct SceneAbout {
  const char* name;
  const char* seen;    // what is seen
  const char* source;  // where its data are from
  std::vector<SceneFile> needs;
  bool needs_importers;  // reads a format that VOXELD_IMPORTERS adds
  // Reads and computes all that takes time; for any thread. An error is of the files.
  absl::StatusOr<std::unique_ptr<Scene>> (*make)(const SceneSettings& settings);
};

// In the order of kSceneNames, by these names.
std::span<const SceneAbout> Scenes();

// Returns: the files of SceneAbout::needs; Unimplemented with the option that adds what the scene needs, where this build lacks it;
// NotFound with what brings the first missing file.
absl::StatusOr<std::vector<std::string>> FindWhatSceneNeeds(const SceneAbout& scene,
                                                            const std::vector<std::string>& roots);

}  // namespace voxeld::voxelctl
