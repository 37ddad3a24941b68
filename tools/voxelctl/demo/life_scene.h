// Life on the stage: cells that live bright, those that fade darker and darker.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/scene.h"

namespace voxeld::voxelctl {

// A life that is over is followed by the next one, of the next seed.
absl::StatusOr<std::unique_ptr<Scene>> MakeLife(const SceneSettings& settings);

}  // namespace voxeld::voxelctl
