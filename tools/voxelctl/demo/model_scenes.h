// Scenes of models that move as a whole: files, and models that are generated once.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/scene.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

absl::StatusOr<std::unique_ptr<Scene>> MakeGlobe(const SceneSettings& settings);
absl::StatusOr<std::unique_ptr<Scene>> MakeEarthquakes(const SceneSettings& settings);
absl::StatusOr<std::unique_ptr<Scene>> MakeHouse(const SceneSettings& settings);
absl::StatusOr<std::unique_ptr<Scene>> MakeEngine(const SceneSettings& settings);
absl::StatusOr<std::unique_ptr<Scene>> MakeBrain(const SceneSettings& settings);
absl::StatusOr<std::unique_ptr<Scene>> MakeMolecule(const SceneSettings& settings);
absl::StatusOr<std::unique_ptr<Scene>> MakeGalaxy(const SceneSettings& settings);

// Returns the part of a volume that is above `low`, without its surroundings; the whole volume if
// nothing is above `low`.
SampledVolume Cropped(const SampledVolume& volume, double low);

}  // namespace voxeld::voxelctl
