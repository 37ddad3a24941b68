// The demo's scenes by name, in the order in which they are played.
#pragma once

#include <array>

namespace voxeld::voxelctl {

inline constexpr std::array<const char*, 10> kSceneNames = {
    "globe",    "earthquakes", "house",  "engine", "brain",
    "molecule", "gyroid",      "galaxy", "life",   "clock"};

}  // namespace voxeld::voxelctl
