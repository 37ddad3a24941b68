// A gyroid by its expression, whose level goes up and down.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/scene.h"

namespace voxeld::voxelctl {

// The level at a time: between −1 and 1, where the surface has not come apart yet (that is at √2).
double GyroidLevel(double seconds);

absl::StatusOr<std::unique_ptr<Scene>> MakeGyroid(const SceneSettings& settings);

}  // namespace voxeld::voxelctl
