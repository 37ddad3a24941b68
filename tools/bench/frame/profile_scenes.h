// Scenes that measure slicing for the displays of the shipped profiles.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/bench/frame/scene.h"

namespace voxeld::bench::frame {

// Returns a row for each profile: 400 solid balls and 20,000 lines in colours of their own, all of
// which move by a voxel back and forth. Slicing is measured, against a copy of as many bytes as the
// volume and the slice images have. Profiles are found as the daemon finds them
// (display/profiles/profile.h).
std::vector<MakeScene> ProfileScenes(uint64_t seed, double share);

}  // namespace voxeld::bench::frame
