// Shows Life on the stage: live cells are bright, and fading ones get darker.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/scene.h"

namespace voxeld::voxelctl {

// Follows a life that has ended with another one, of the next seed.
absl::StatusOr<std::unique_ptr<Scene>> MakeLife(const SceneSettings& settings);

}  // namespace voxeld::voxelctl
