// The local time as text, in a rotating ring of hours.
#pragma once

#include <ctime>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "tools/voxelctl/demo/scene.h"

namespace voxeld::voxelctl {

// Returns hours and minutes on one line, seconds below: "09:05\n07".
std::string ClockText(const std::tm& time);

absl::StatusOr<std::unique_ptr<Scene>> MakeClock(const SceneSettings& settings);

}  // namespace voxeld::voxelctl
