// A gyroid given by its expression, whose level rises and falls.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/scene.h"

namespace voxeld::voxelctl {

// Returns the level at a time: between −1 and 1, where the surface is still connected (it separates
// at √2).
double GyroidLevel(double seconds);

absl::StatusOr<std::unique_ptr<Scene>> MakeGyroid(const SceneSettings& settings);

}  // namespace voxeld::voxelctl
