// Draws what a scene must look like: the plain scene, drawn whole, once, by a fresh engine.
#pragma once

#include <cstddef>
#include <vector>

#include "display/api/display.h"
#include "tests/daemon/core/model/plain_scene.h"

namespace voxeld::simulation {

// Returns the slice images of a volume, packed as `info` says, seen through a view in voxels.
std::vector<std::byte> DrawPlain(const daemon::model::PlainScene& scene,
                                 const display::DisplayInfo& info);

}  // namespace voxeld::simulation
